"""A terminal that is never waited for. POSIX only.

A terminal that is not read (a hung ssh, a slow line) must hold up nothing but the picture. Textual
queues its updates and waits where the queue is full, in the event loop that also runs the session
and its stop. Here a frame is sent only when the terminal has taken the one before; what changed
meanwhile goes with the next one (:mod:`app.tui.painting`).
"""

import io
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import IO, Any, cast

from textual.drivers.linux_driver import LinuxDriver
from textual.events import Key
from textual.message import Message

from app.tui.signs import in_ascii, only_ascii

LEAVE_S = 2.0
"""How long the end of the program waits for a terminal that takes nothing."""

BELL = "\07"


class PatientDriver(LinuxDriver):
    """Textual's driver, that knows whether the terminal has taken what was sent.

    While it has not, control sequences are held back; they go before the next frame.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._taken = _Taken(self._file, self._on_taken)
        self._file = cast("Any", self._taken)  # the writer's thread asks for no more of a file
        self._sent = 0
        self._held: list[str] = []
        self._ascii = only_ascii(os.environ)
        self.on_taken: Callable[[], None] | None = None
        """Called in the writer's thread when the terminal has taken everything; nothing is held
        back before it is set."""

        self.at_once: dict[str, Callable[[], None]] = {}
        """What keys do in the thread that reads them, before the event loop hears of them."""

    def process_message(self, message: Message) -> None:
        """Let a key that waits for nothing work; then tell the program of it, as of any other."""
        if isinstance(message, Key) and (act := self.at_once.get(message.key)) is not None:
            threading.Thread(target=act, name=f"at once {message.key}", daemon=True).start()
        super().process_message(message)

    @property
    def busy(self) -> bool:
        """Whether something that was sent has not been taken yet."""
        return self._sent != self._taken.flushed

    def write(self, data: str) -> None:
        """Send, or hold back while the terminal is behind; never waits."""
        if self.on_taken is not None and (self.busy or self._held):
            if data != BELL or BELL not in self._held:
                self._held.append(data)
            return
        self._send(data)

    def _send(self, data: str) -> None:
        data = in_ascii(data) if self._ascii else data
        self._sent += len(data)
        super().write(data)

    def release(self) -> None:
        """Send what was held back."""
        held, self._held = "".join(self._held), []
        if held:
            self._send(held)

    def _on_taken(self) -> None:
        if self.on_taken is not None and not self.busy:
            self.on_taken()

    def close(self) -> None:
        """End the writer; a terminal that takes nothing any more is left after a moment."""
        self.release()
        until = time.monotonic() + LEAVE_S
        while self.busy and time.monotonic() < until:
            time.sleep(0.01)
        if not self.busy:
            super().close()


class _Taken(io.TextIOBase):
    """The terminal's file; counts the characters that it has taken. Used by the writer's thread."""

    def __init__(self, file: IO[str] | None, on_taken: Callable[[], None]) -> None:
        super().__init__()
        self._terminal = file or sys.stderr
        self._on_taken = on_taken
        self._written = 0
        self.flushed = 0

    def write(self, text: str) -> int:
        """Write to the terminal; waits while it takes nothing."""
        self._terminal.write(text)
        self._written += len(text)
        return len(text)

    def flush(self) -> None:
        """Push everything out, then say so."""
        self._terminal.flush()
        self.flushed = self._written
        self._on_taken()

    def fileno(self) -> int:
        """Return the terminal's own number."""
        return self._terminal.fileno()
