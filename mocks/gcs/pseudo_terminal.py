"""A pseudo terminal as the far end of a serial line; POSIX only."""

import contextlib
import os
import select
import sys

READ_SIZE = 4096


class PseudoTerminal:
    """The controller's end; :attr:`path` is what a client opens as its serial port.

    The other end is kept open here as well: a client that closes its port does not end the line.
    Raises OSError where there are none (Windows).
    """

    def __init__(self) -> None:
        if sys.platform == "win32":
            raise OSError("there are no pseudo terminals on Windows: use TCP")
        import tty  # not on Windows

        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._near, False)
        self.path = os.ttyname(self._far)
        self._closed = False

    def read(self, timeout: float) -> bytes:
        """Return what has come within ``timeout`` s; empty if nothing has."""
        ready, _, _ = select.select([self._near], [], [], timeout)
        return os.read(self._near, READ_SIZE) if ready else b""

    def write(self, data: bytes) -> None:
        """Send; what a client does not read is lost once the line's buffer is full."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._near, data)

    def close(self) -> None:
        """End the line: whoever has it open gets an error."""
        if not self._closed:
            self._closed = True
            for end in (self._near, self._far):
                os.close(end)
