"""The step list: only the lines in view are drawn, so a plan of thousands costs nothing."""

from collections.abc import Sequence

from rich.segment import Segment
from rich.style import Style
from textual.geometry import Size
from textual.scroll_view import ScrollView
from textual.strip import Strip

from app.tui.parts import StepLine
from app.tui.theme import MARKS, STYLES, tinted


class StepList(ScrollView, can_focus=True):
    """Steps with a sign for their state; follows the step in work unless the operator scrolls."""

    def __init__(self, *, id: str) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._steps: Sequence[StepLine] = ()
        self._current: int | None = None
        self.border_title = "Steps"

    def show(self, steps: Sequence[StepLine], current: int | None) -> None:
        """Draw these steps; scroll so that the one in work stays in the middle."""
        if len(steps) != self.virtual_size.height:
            self.virtual_size = Size(0, len(steps))
        self._steps = steps
        moved = current != self._current
        self._current = current
        if moved:
            self._follow()
        self.refresh()

    def on_resize(self) -> None:
        """Keep the step in work in the middle."""
        self._follow()

    def _follow(self) -> None:
        if self._current is not None and not self.has_focus:
            middle = max(0, self._current - self.size.height // 2)
            self.scroll_to(y=middle, animate=False, force=True)

    def render_line(self, y: int) -> Strip:
        """Draw one line."""
        width = self.scrollable_content_region.width
        index = y + self.scroll_offset.y
        base = self.rich_style
        if index >= len(self._steps):
            return Strip.blank(width, base)
        step = self._steps[index]
        style = base + Style.parse(tinted(self.app, STYLES[step.state]))
        if index == self._current:
            style += Style(reverse=True)
        number = f"{index + 1:>{len(str(len(self._steps)))}} "
        text = f"{MARKS[step.state]} {step.says}"
        room = width - len(number)
        text = text if len(text) <= room else text[: room - 1] + "…"
        return Strip(
            [Segment(number, base + Style(dim=True)), Segment(text.ljust(room), style)], width
        )
