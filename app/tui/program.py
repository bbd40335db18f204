"""The terminal program: screens, the keys that work everywhere, and who puts errors up."""

import asyncio
import signal
from collections.abc import Awaitable, Callable, Iterable
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, ClassVar

from textual.app import SystemCommand
from textual.binding import Binding, BindingType
from textual.events import Event, MouseDown
from textual.screen import Screen

from app.errors import GateRefused, StoppedByOperator
from app.session.events import PromptNeeded
from app.tui.apply import ApplyFace
from app.tui.auto import AutoFace
from app.tui.desk import POLL_S, Desk
from app.tui.devices import DevicesFace
from app.tui.dialogs import Choose, Help, question
from app.tui.discover import DiscoverFace
from app.tui.face import Face
from app.tui.fit import FitFace
from app.tui.history import HistoryFace
from app.tui.log import LogFace
from app.tui.measure import MeasureFace
from app.tui.painting import Painted
from app.tui.preferences import keep_theme, kept_theme
from app.tui.residuals import ResidualsFace
from app.tui.theme import BENCH, with_inks
from app.tui.verify import VerifyFace
from app.tui.watch import WatchFace
from app.tui.widgets.frame import STOP_KEY
from app.tui.wording import micro, said
from calib.errors import BadInput
from drivers.errors import DeviceError

FACES: tuple[type[Face], ...] = (
    DevicesFace, MeasureFace, FitFace, DiscoverFace, ApplyFace, VerifyFace, LogFace, AutoFace,
)  # fmt: skip
SIDES: tuple[type[Face], ...] = (ResidualsFace, HistoryFace, WatchFace)
"""Screens that are reached from others, and left with escape."""
FORESEEN = (BadInput, DeviceError, GateRefused, OSError)


class Workbench(Painted[None]):
    """The operator's screens."""

    CSS_PATH = "pkmcal.tcss"
    TITLE = "pkmcal"
    MODES: ClassVar[dict[str, str | Callable[[], Screen[Any]]]] = {
        face.mode: face for face in (*FACES, *SIDES)
    }
    DEFAULT_MODE = FACES[0].mode
    COMMAND_PALETTE_BINDING = "ctrl+p"
    BINDINGS: ClassVar[list[BindingType]] = [
        # Priority: it also works in dialogs, in text lines and in the palette. It is one byte
        # (0x18) in every terminal, so no multiplexer takes it for the start of something else.
        Binding(STOP_KEY, "stop_all", "STOP", priority=True, show=False,
                tooltip="Stop all motion and the job, at any moment"),
        *(
            Binding(str(number), f"show_face('{face.mode}')", face.label, show=False,
                    tooltip=f"Show the screen {face.label}")
            for number, face in enumerate(FACES, start=1)
        ),
        Binding("r", "answer", "Reply", show=False, tooltip="Reply to what the job asks"),
        Binding("b", "hide_banner", "Hide banner", show=False,
                tooltip="Hide the banner; its text stays in the log"),
        Binding("f1", "help", "Help", tooltip="What this screen is for, and its keys"),
        Binding("ctrl+p", "command_palette", "Find", tooltip="Find any action by its name"),
        Binding("ctrl+q", "quit", "Quit", tooltip="Leave; asks if a job runs"),
    ]  # fmt: skip

    def __init__(
        self,
        site: Path | None = None,
        *,
        root: Path = Path("sessions"),
        ends_on_signals: bool = False,
    ) -> None:
        super().__init__()
        self.desk = Desk(root)
        self.tabs = tuple((face.mode, face.label) for face in FACES)
        self._site = site
        self._ends_on_signals = ends_on_signals
        self._asked: PromptNeeded | None = None
        self._rung: PromptNeeded | None = None
        self._came_from = self.DEFAULT_MODE

    def get_css_variables(self) -> dict[str, str]:
        """Give the theme's colours, and their inks for text."""
        self.theme_variables = with_inks(super().get_css_variables())
        return self.theme_variables

    def on_mount(self) -> None:
        """Open the site that the command line named, and begin to watch."""
        self.start_painting()
        self.at_once(STOP_KEY, self.desk.stop_at_once)
        self.register_theme(BENCH)
        kept = kept_theme()
        self.theme = kept if kept in self.available_themes else BENCH.name
        self.theme_changed_signal.subscribe(self, lambda theme: keep_theme(theme.name))
        self.set_interval(0.1, self._watch_prompt)
        self.run_worker(self._watch_devices(), group="poll", exit_on_error=True)
        self.run_worker(self._warm_up(), group="warm-up", exit_on_error=True)
        if self._ends_on_signals:
            self._end_on_signals()
        if self._site is not None:
            site = self._site
            self.act(lambda: self.desk.open_site(site))

    def _end_on_signals(self) -> None:
        """Stop the machine when the terminal is closed or the process is asked to end."""
        loop = asyncio.get_running_loop()

        def leave(number: int, frame: FrameType | None) -> None:
            loop.call_soon_threadsafe(lambda: self.run_worker(self._close(), exit_on_error=True))

        for name in ("SIGTERM", "SIGHUP"):
            if hasattr(signal, name):  # no SIGHUP on Windows
                signal.signal(getattr(signal, name), leave)

    async def _close(self) -> None:
        await self.desk.close()
        self.exit()

    async def _warm_up(self) -> None:
        """Import what the analysis needs while the operator looks at the first screen."""
        for module in ("app.tui.discovering", "app.auto.flight"):
            await asyncio.to_thread(import_module, module)

    async def _watch_devices(self) -> None:
        while True:
            try:
                await self.desk.poll()
            except FORESEEN as error:
                self.put_up(error)
            await asyncio.sleep(POLL_S)

    # actions and their errors

    def act(self, what: Callable[[], Awaitable[Any]], *, busy: str = "") -> None:
        """Run a coroutine beside the screen; what can be foreseen goes to the banner."""

        async def guarded() -> None:
            try:
                await what()
            except StoppedByOperator:
                self.desk.picture.revision += 1  # its event has said so already
            except FORESEEN as error:
                self.put_up(error)
            finally:
                if busy and picture.doing == busy:
                    picture.doing = ""
                    picture.revision += 1

        picture = self.desk.picture
        picture.pass_on()
        if busy:
            picture.write(busy)
            picture.doing = busy
        self.run_worker(guarded(), group="act", exit_on_error=True)

    def put_up(self, error: Exception) -> None:
        """Put an error on the banner: what happened and what to do.

        A fault of the job stands there already, in words that say what it means and how to go on.
        """
        what, remedy = map(micro, said(error))
        picture = self.desk.picture
        if picture.trouble is not None and what in picture.trouble.what:
            return
        if isinstance(error, (BadInput, GateRefused)):
            picture.refuse(what, remedy)
        else:
            picture.say_trouble(what, remedy)

    # keys that work everywhere

    def action_stop_all(self) -> None:
        """Stop; never waits for anything else that runs here."""

        async def stop() -> None:
            ends_a_job = self.desk.busy
            words = await self.desk.stop()
            self.desk.picture.write(f"STOP: {words}", "warn")
            if not ends_a_job or "NOT" in words:  # a job that was stopped says so on the banner
                self.notify(words, title="STOP", severity="warning")

        self.run_worker(stop(), group="stop", exit_on_error=True)

    async def on_event(self, event: Event) -> None:
        """Let STOP at the top work by mouse under whatever lies over the screen."""
        if isinstance(event, MouseDown) and not isinstance(self.screen, Face):
            for stop in self.screen_stack[0].query("#top-stop"):
                if stop.region.contains(event.screen_x, event.screen_y):
                    self.action_stop_all()
        await super().on_event(event)

    def action_show_face(self, mode: str) -> None:
        """Change to another screen."""
        self.desk.picture.pass_on()
        self.switch_mode(mode)

    def action_show_side(self, mode: str) -> None:
        """Change to a screen that goes back to where it was called."""
        if self.current_mode not in (face.mode for face in SIDES):
            self._came_from = self.current_mode
        self.switch_mode(mode)

    def action_leave_side(self) -> None:
        """Go back from such a screen."""
        self.switch_mode(self._came_from)

    def action_hide_banner(self) -> None:
        """Take the banner away."""
        self.desk.picture.trouble = None
        self.desk.picture.revision += 1

    def action_answer(self) -> None:
        """Open the job's question again."""
        if self.desk.picture.prompt is None:
            self.notify("The job asks nothing.")
        self._asked = None

    def action_help(self) -> None:
        """Show what the screen is for and its keys."""
        face = self.screen
        if not isinstance(face, Face):
            return
        keys = [
            (self.get_key_display(binding), binding.description, binding.tooltip)
            for binding in bindings_of(type(face)) + bindings_of(type(self))
            if not binding.action.startswith("show_face")
        ]
        keys.append((f"1-{len(FACES)}", "Screens", "Show a screen"))
        self.push_screen(Help(f"Help: {face.label}", face.about, keys))

    async def action_quit(self) -> None:
        """Leave; a running job is asked for first."""
        if not self.desk.busy:
            await self._close()
            return

        async def leave(answer: str | None) -> None:
            if answer == "stop and leave":
                await self._close()

        text = (
            "A job is running. Leaving stops the machine and ends the job; nothing measured is "
            "lost, and it can be gone on with later."
        )
        self.push_screen(Choose("Leave?", text, ("go on", "stop and leave")), leave)

    # the job's questions

    def _watch_prompt(self) -> None:
        prompt = self.desk.picture.prompt
        # Names of questions repeat from session to session: it is the question itself that counts.
        if prompt is None or prompt is self._asked or not isinstance(self.screen, Face):
            return
        self._asked = prompt
        if self._rung is not prompt:
            self._rung = prompt
            self.bell()

        def asked_still() -> bool:
            return self.desk.picture.prompt is prompt

        def answered(choice: str | None) -> None:
            if choice is not None and asked_still():
                try:
                    self.desk.answer(prompt.prompt, choice)
                except GateRefused as late:  # the job has ended meanwhile
                    self.put_up(late)

        self.push_screen(question(prompt, asked_still), answered)

    # the palette

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """Offer every action of every screen, and Textual's own."""
        for binding in bindings_of(type(self)):
            if binding.action == "command_palette":
                continue
            action = binding.action
            yield SystemCommand(
                binding.description, f"{binding.tooltip} ({binding.key})",
                lambda action=action: self.run_worker(self.run_action(action)),
            )  # fmt: skip
        for face in (*FACES, *SIDES):
            for binding in bindings_of(face):
                yield SystemCommand(
                    f"{face.label}: {binding.description}",
                    f"{binding.tooltip} ({self.get_key_display(binding)})",
                    self._caller(face.mode, binding.action),
                )
        for command in super().get_system_commands(screen):
            if command.title in ("Theme", "Screenshot"):
                yield command

    def _caller(self, mode: str, action: str) -> Callable[[], None]:
        async def call() -> None:
            if mode in (face.mode for face in SIDES):
                self.action_show_side(mode)
            await self.switch_mode(mode)
            await self.run_action(action, self.screen)

        def start() -> None:
            self.run_worker(call())

        return start


def bindings_of(owner: type[Any]) -> list[Binding]:
    """Every key that a screen or the program defines itself."""
    return [binding for binding in owner.__dict__["BINDINGS"] if isinstance(binding, Binding)]
