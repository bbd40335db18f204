"""An app whose frames are differences, sent when the terminal has taken the one before."""

import asyncio
import contextlib
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import RenderableType
from rich.control import Control
from textual._context import visible_screen_stack
from textual.app import App
from textual.screen import Screen
from textual.strip import Strip

from app.tui.difference import changes

if TYPE_CHECKING:
    from app.tui.terminal import PatientDriver

SYNCHRONISED = "\x1b[?2026h", "\x1b[?2026l"
"""The terminal shows what is between these at once (DEC private mode 2026)."""

ReturnT = TypeVar("ReturnT")


def patient_driver() -> "type[PatientDriver] | None":
    """Return the driver that is never waited for; None where there is none (Windows)."""
    if sys.platform == "win32":
        return None
    from app.tui.terminal import PatientDriver

    return PatientDriver


class Painted(App[ReturnT]):
    """Draws as Textual does where its driver is another one (Windows, tests without a terminal)."""

    def __init__(self, **options: Any) -> None:
        super().__init__(driver_class=patient_driver(), **options)
        self._patient: PatientDriver | None = None
        self._shown: Sequence[Strip] = ()
        self._cursor = (-1, -1)
        self._behind = False

    def start_painting(self) -> None:
        """Take over from Textual's own drawing; once, when the program has its terminal."""
        kind = patient_driver()
        if kind is None or not isinstance(self._driver, kind):
            return
        self._patient, loop = self._driver, asyncio.get_running_loop()

        def taken() -> None:  # in the writer's thread, perhaps after the loop has ended
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(self._on_taken)

        self._patient.on_taken = taken
        self.app_resume_signal.subscribe(self, lambda _: self._paint_anew(), immediate=True)

    def at_once(self, key: str, act: Callable[[], None]) -> None:
        """Let a key act in a thread, too, as soon as it is read; where the terminal is ours."""
        if self._patient is not None:
            self._patient.at_once[key] = act

    def _on_taken(self) -> None:
        if self._patient is None or self._patient.busy:
            return
        self._patient.release()
        if self._behind:
            self._paint(self._patient)

    def _paint_anew(self) -> None:
        self._shown = ()
        self.screen.refresh()

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        if self._patient is None or self._batch_count or renderable is None:
            super()._display(screen, renderable)
            return
        if self._running and not self._closed:
            self._paint(self._patient)
        self.post_display_hook()

    def _paint(self, driver: "PatientDriver") -> None:
        """Bring the terminal to what the screen shows now, unless it is behind anyway."""
        self._behind = driver.busy
        if self._behind:
            return
        visible_screen_stack.set(self._background_screens)
        wanted = self.screen._compositor.render_strips(self.size)
        console = self.console
        text = "".join(
            Control.move_to(x, y).segment.text + strip.render(console)
            for x, y, strip in changes(self._shown, wanted)
        )
        cursor = self.screen.outer_size.clamp_offset(self.cursor_position)
        if not text and cursor == self._cursor:
            return
        self._shown, self._cursor = wanted, cursor
        text += Control.move_to(*cursor).segment.text
        if self._sync_available:
            text = text.join(SYNCHRONISED)
        driver.write(text)
