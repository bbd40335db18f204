"""Log: everything that was said, newest below; only what is in view is drawn."""

from typing import ClassVar

from rich.segment import Segment
from rich.style import Style
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.geometry import Size
from textual.scroll_view import ScrollView
from textual.strip import Strip

from app.tui.face import Face
from app.tui.parts import LogLine
from app.tui.picture import Picture
from app.tui.theme import LEVELS, tinted


class LogFace(Face):
    """The last screen."""

    mode = "log"
    label = "Log"
    about = (
        "Everything that was said since the program started. w shows warnings and faults only. "
        "Arrows and page keys scroll; end follows the newest line again. The journal in the "
        "session's folder keeps it for good."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#log"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("w", "warnings", "Warnings only", tooltip="Show warnings and faults only, or all"),
    ]

    def body(self) -> ComposeResult:
        """One long list."""
        yield LogLines(id="log")

    def show(self, picture: Picture) -> None:
        """Draw the lines."""
        self.query_one(LogLines).show(picture)

    def action_warnings(self) -> None:
        """Filter, or do not."""
        lines = self.query_one(LogLines)
        lines.only_warnings = not lines.only_warnings
        lines.show(self.desk.picture)


class LogLines(ScrollView, can_focus=True):
    """A virtual list of log lines; stays at the end unless the operator scrolls up."""

    def __init__(self, *, id: str) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self.only_warnings = False
        self._rows: list[tuple[LogLine, str]] = []
        self._made_of: tuple[int, bool, int] | None = None
        self._picture: Picture | None = None

    def show(self, picture: Picture) -> None:
        """Wrap what is new; nothing is done if nothing is."""
        if picture is not self._picture:
            self._picture, self._made_of = picture, None
        made_of = (picture.logged, self.only_warnings, self._width)
        if made_of == self._made_of or not self._width:
            return
        at_end = self._made_of is None or self.scroll_offset.y >= self.max_scroll_y - 1
        self._made_of = made_of
        self._rows = []
        for line in picture.log:
            if not self.only_warnings or line.level in ("warn", "bad"):
                self._rows += [(line, part) for part in self._wrapped(line)]
        self.virtual_size = Size(0, len(self._rows))
        what = "warnings and faults" if self.only_warnings else "everything"
        self.border_title = f"Log: {what}"
        self.refresh()
        if at_end:  # the new size counts once it is laid out
            self.call_after_refresh(self.scroll_end, animate=False)

    @property
    def _width(self) -> int:
        return self.scrollable_content_region.width

    def on_resize(self) -> None:
        """Wrap for the new width at the next drawing."""
        self._made_of = None
        if self._picture is not None:
            self.call_after_refresh(self.show, self._picture)

    def _wrapped(self, line: LogLine) -> list[str]:
        sign, _ = LEVELS[line.level]
        when = f"{line.time_s:9.1f} s" if line.time_s is not None else " " * 11
        head, indent = f"{when} {sign} ", " " * 14
        room = max(20, self._width - len(head))
        parts, rest = [], line.text
        while len(rest) > room:
            cut = rest.rfind(" ", 0, room)
            cut = cut if cut > room // 2 else room
            parts.append(rest[:cut])
            rest = rest[cut:].lstrip()
        parts.append(rest)
        return [(head if number == 0 else indent) + part for number, part in enumerate(parts)]

    def render_line(self, y: int) -> Strip:
        """Draw one line."""
        index = y + self.scroll_offset.y
        base = self.rich_style
        if index >= len(self._rows):
            return Strip.blank(self._width, base)
        line, text = self._rows[index]
        style = base + Style.parse(tinted(self.app, LEVELS[line.level][1]))
        return Strip([Segment(text.ljust(self._width)[: self._width], style)])
