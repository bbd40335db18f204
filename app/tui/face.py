"""The base of every screen: frame, coalesced drawing, and actions that answer on the banner."""

from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any, ClassVar, cast

from textual.app import ComposeResult
from textual.screen import Screen
from textual.widgets import Footer

from app.tui.desk import Desk
from app.tui.next_step import NextLine
from app.tui.picture import Picture
from app.tui.widgets.frame import Banner, TabLine, TopLine

if TYPE_CHECKING:
    from app.tui.program import Workbench

DRAW_S = 0.22
"""Screens are drawn at most this often, whatever the engine says in between."""

WIDE, TALL = 110, 36
"""Columns and lines from which a screen shows more."""


class Face(Screen[None]):
    """One screen. A subclass gives :meth:`body` and :meth:`show`, its keys and its help."""

    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (WIDE, "-wide")]  # noqa: RUF012 - Textual's own
    VERTICAL_BREAKPOINTS = [(0, "-low"), (TALL, "-tall")]  # noqa: RUF012 - Textual's own

    # The keys belong to the screen until the operator goes into a list with tab.
    AUTO_FOCUS: ClassVar[str | None] = ""

    mode: ClassVar[str] = ""
    label: ClassVar[str] = ""
    about: ClassVar[str] = ""
    """What the screen is for: the head of its help."""

    def __init__(self) -> None:
        super().__init__()
        self._seen = -1
        self._drawn: object = None

    @property
    def bench(self) -> "Workbench":
        """The program."""
        return cast("Workbench", self.app)

    @property
    def desk(self) -> Desk:
        """Site, station and session."""
        return self.bench.desk

    def compose(self) -> ComposeResult:
        """The frame around the body."""
        yield TopLine(id="top")
        yield TabLine(self.bench.tabs, self.mode)
        yield NextLine("", id="next")
        yield from self.body()
        yield Banner(id="banner")
        yield Footer(show_command_palette=False, compact=True)

    def body(self) -> ComposeResult:
        """Give the screen's own widgets."""
        yield from ()

    def on_mount(self) -> None:
        """Begin drawing."""
        self.draw()
        self.set_interval(DRAW_S, self._tick)
        self.app.theme_changed_signal.subscribe(self, lambda _: self._draw_anew())

    def _draw_anew(self) -> None:
        """Draw what else would be left as it is: its colours are others."""
        self._drawn = None
        self.draw()

    def on_screen_resume(self) -> None:
        """Draw what was missed while another screen was shown."""
        self.draw()

    def on_resize(self) -> None:
        """Draw for the new size: what has room depends on it."""
        self.call_after_refresh(self.draw)

    def _tick(self) -> None:
        if self.is_current and self._seen != self.desk.picture.revision:
            self.draw()

    def draw(self) -> None:
        """Draw the present picture."""
        picture = self.desk.picture
        self._seen = picture.revision
        site = self.desk.site
        name = (site.title or site.machine.name) if site is not None else "no site open"
        self.query_one("#top", TopLine).show(picture, name, self.desk.connected)
        self.query_one("#next", NextLine).show(self.desk)
        self.query_one("#banner", Banner).show(picture)
        self.show(picture)

    def show(self, picture: Picture) -> None:
        """Draw the body."""

    @property
    def wide(self) -> bool:
        """Whether there is room for more than 80 columns ask for."""
        return self.app.size.width >= WIDE

    @property
    def low(self) -> bool:
        """Whether there are hardly more lines than 24."""
        return self.app.size.height < TALL

    def act(self, what: Callable[[], Awaitable[Any]], *, busy: str = "") -> None:
        """Run an action of the desk without blocking the screen; errors go to the banner."""
        self.bench.act(what, busy=busy)
