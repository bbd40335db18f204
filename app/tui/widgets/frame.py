"""What frames every screen: the line at the top with state and stop key, the tabs, the banner."""

from textual.app import ComposeResult, RenderResult
from textual.containers import Horizontal
from textual.content import Content
from textual.reactive import reactive
from textual.widget import Widget
from textual.widgets import Static

from app.show.spans import duration
from app.tui.picture import Picture

STOP_KEY = "ctrl+x"

_RUN = {
    "running": "▶ running",
    "paused": "‖ paused",
    "waiting": "! waiting",
    "stopped": "■ stopped",
    "fault": "✗ fault",
    "finished": "✓ finished",
}


class TopLine(Horizontal):
    """Which site, what state, how to stop: always there."""

    def compose(self) -> ComposeResult:
        """Three parts; the stop key keeps its place whatever the others say."""
        yield Static("", id="top-site")
        yield Static("", id="top-state")
        yield Static(f"[@click=app.stop_all] STOP {STOP_KEY} [/]", id="top-stop")

    def show(self, picture: Picture, site: str, connected: bool) -> None:
        """Draw the picture's state."""
        self.query_one("#top-site", Static).update(Content(f"pkmcal  {site}"))
        state = self.query_one("#top-state", Static)
        state.update(Content(state_text(picture, connected)))
        for name in _RUN:
            state.set_class(picture.run == name and picture.prompt is None, f"-{name}")
        state.set_class(picture.prompt is not None, "-asking")


def state_text(picture: Picture, connected: bool) -> str:
    """Say in a few words what goes on, the most urgent first."""
    if picture.prompt is not None:
        return "? asks you: r replies"
    if picture.doing and not picture.busy:
        return f"… {picture.doing.removesuffix(' ...')}"
    if picture.run == "idle":
        return "● connected" if connected else "○ not connected"
    text = _RUN[picture.run]
    progress = picture.progress
    if picture.busy and progress is not None:
        text += f" {progress.done}/{progress.total}"
        if progress.remaining_s is not None:
            text += f" · {duration(progress.remaining_s)} left"
    return text if connected or picture.busy else f"{text} · not connected"


class TabLine(Widget):
    """The screens with their number keys, the present one marked."""

    here: reactive[str] = reactive("")

    def __init__(self, faces: tuple[tuple[str, str], ...], here: str) -> None:
        super().__init__()
        self._faces = faces
        self.set_reactive(TabLine.here, here)

    def render(self) -> RenderResult:
        """Draw all tabs in one line."""
        parts = []
        for number, (mode, label) in enumerate(self._faces, start=1):
            if mode == self.here:
                parts.append(f"[bold reverse]▸{number} {label} [/]")
            else:
                parts.append(f"[@click=app.show_face('{mode}')] [bold]{number}[/] {label} [/]")
        return Content.from_markup("".join(parts))


class Banner(Static):
    """What went wrong and what to do; hidden while there is nothing."""

    def show(self, picture: Picture) -> None:
        """Draw the picture's trouble, if any."""
        trouble = picture.trouble
        self.display = trouble is not None
        if trouble is None:
            return
        self.set_class(trouble.level == "warn", "-warn")
        mark = "!" if trouble.level == "warn" else "✗"
        text = Content.assemble((f"{mark} {trouble.what}", "bold"), ("   b hides this", "dim"))
        if trouble.remedy:
            text = Content.assemble(text, "\n→ ", trouble.remedy)
        self.update(text)
