"""Watch: a session that another terminal runs, read-only."""

from pathlib import Path
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.content import Content
from textual.widgets import Static

from app.session.facts import sessions_under
from app.tui.dialogs import Pick
from app.tui.face import Face
from app.tui.log import LogLines
from app.tui.picture import Picture
from app.tui.starting import session_words
from app.tui.watching import Watching
from calib.errors import BadInput

POLL_S = 0.5
OFFERED = 20
"""Sessions that are offered, the newest first; those that are not finished before the others."""
BAR = 30
"""Signs of the bar."""


class WatchFace(Face):
    """Reached by a from Devices."""

    mode = "watch"
    label = "Watch"
    about = (
        "A session that another terminal runs, as its journal tells of it: what happened, the "
        "newest below, and how far it has come. Nothing that is done here reaches the machine; "
        "the stop key of this terminal stops only what this terminal runs. Stop the watched "
        "session where it runs, or with the emergency stop. o chooses another one."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#watch-lines"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("o", "choose", "Session", tooltip="Choose the session that is watched"),
        Binding("escape", "app.leave_side", "Back", tooltip="Back to where you came from"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._asked = False

    def body(self) -> ComposeResult:
        """What it is and how far, over what happened."""
        yield Static(id="watch-state", classes="panel")
        yield LogLines(id="watch-lines")

    def on_mount(self) -> None:
        """Begin to read."""
        self.query_one("#watch-state").border_title = "Watched, read-only"
        self.set_interval(POLL_S, self._look)

    def on_screen_resume(self) -> None:
        """Ask which session, if none is watched yet."""
        super().on_screen_resume()
        if self.desk.watched is None and not self._asked:
            self._asked = True
            self.action_choose()

    async def _look(self) -> None:
        watched = self.desk.watched
        if not self.is_current or watched is None:
            return
        try:
            await watched.look()
        except (BadInput, OSError) as gone:
            self.desk.watched = None
            self.bench.put_up(gone)
        self.draw()

    def show(self, picture: Picture) -> None:
        """Draw the state and the lines."""
        watched = self.desk.watched
        self.query_one("#watch-state", Static).update(state_text(watched))
        if watched is not None:
            lines = self.query_one(LogLines)
            lines.show(watched.picture)
            lines.border_title = "What happened, by the clock"

    def action_choose(self) -> None:
        """Choose a session of the folder."""
        found = sessions_under(self.desk.root, OFFERED)
        found.sort(key=lambda facts: facts.state != "begun")
        if not found:
            self.notify(f"No session in {self.desk.root}.")
            return

        def picked(answer: str | None) -> None:
            if answer:
                self.act(lambda: self._watch(Path(answer)))

        options = [(str(facts.folder), session_words(facts)) for facts in found]
        self.app.push_screen(
            Pick("Watch", "Sessions, those that are not finished first", options), picked
        )

    async def _watch(self, folder: Path) -> None:
        self.desk.watched = Watching(folder)
        await self._look()


def state_text(watched: Watching | None) -> Content:
    """Which session, how far, what it does."""
    if watched is None:
        return Content.from_markup("[bold $ink-accent]o[/] chooses a session of this folder")
    facts = watched.facts
    machine = f"{facts.machine} {facts.serial}".strip()
    title = f" · {facts.title}" if facts.title else ""
    filled = round(BAR * facts.done / facts.steps) if facts.steps else 0
    bar = "█" * filled + "░" * (BAR - filled)
    words = {"finished": "✓ finished", "broken": "✗ cannot be read"}.get(facts.state, "▶ goes on")
    if watched.quiet_s:
        words = f"! nothing for {watched.quiet_s:.0f} s; is it still running?"
    lines = [
        f"{facts.purpose}, {machine}{title}",
        f"{bar} {facts.done} of {facts.steps} steps, {facts.readings} readings   {words}",
        f"now: {watched.doing}"
        if facts.state == "begun" and watched.doing
        else str(watched.folder),
    ]
    return Content("\n".join(lines))
