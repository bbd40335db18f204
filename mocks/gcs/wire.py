"""The byte stream of one client: lines, and the commands of one byte that may come in between."""

from mocks.gcs.commands import CommandSet
from mocks.gcs.controller import Controller

MOTION, READY, STOP = 0x05, 0x07, 0x18
IS_READY, IS_BUSY = b"\xb1\n", b"\xb0\n"
LONGEST_LINE = 4096
ENCODING = "cp1252"


class Wire:
    """Takes bytes as they come and returns those to send.

    A command of one byte acts at once, in the middle of a line as well: a stop need not wait for
    a line feed.
    """

    def __init__(self, controller: Controller, commands: CommandSet) -> None:
        self._controller = controller
        self._commands = commands
        self._line = bytearray()

    def feed(self, data: bytes) -> bytes:
        """Carry out what has come; returns the answers."""
        self._controller.heard()
        answers = bytearray()
        for byte in data:
            if byte in (MOTION, READY, STOP):
                answers += self._single(byte)
            elif byte == 0x0A:
                line = self._line.decode(ENCODING, "replace")
                self._line.clear()
                answers += self._commands.obey(line).encode(ENCODING)
            elif len(self._line) < LONGEST_LINE:
                self._line.append(byte)
        return bytes(answers)

    def _single(self, byte: int) -> bytes:
        if byte == MOTION:
            return f"{self._controller.motion_mask():X}\n".encode()
        if byte == READY:
            return IS_BUSY if self._controller.busy else IS_READY
        self._controller.stop()
        return b""
