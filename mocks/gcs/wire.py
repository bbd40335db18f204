"""The byte stream of one client: lines, and the commands of one byte that may come in between."""

from typing import Protocol

MOTION, READY, STOP = 0x05, 0x07, 0x18
IS_READY, IS_BUSY = b"\xb1\n", b"\xb0\n"
LONGEST_LINE = 4096
ENCODING = "cp1252"


class Electronics(Protocol):
    """What the bytes act on: a controller of the tripod, or of a closed hexapod."""

    @property
    def busy(self) -> bool:
        """Whether it is not ready for commands."""

    def motion_mask(self) -> int:
        """Bit n of the axes in the order of ``SAI?``: axis n moves."""

    def stop(self) -> None:
        """Stop everything."""

    def heard(self) -> None:
        """Something came from the PC."""

    def tick(self) -> None:
        """What happens by itself."""

    def power_on(self) -> None:
        """Come up anew."""


class Commands(Protocol):
    """What carries out lines."""

    def obey(self, line: str) -> str:
        """Carry out one line; returns the answer, "" if there is none."""


class Wire:
    """Takes bytes as they come and returns those to send.

    A command of one byte acts at once, in the middle of a line as well: a stop need not wait for
    a line feed.
    """

    def __init__(self, controller: Electronics, commands: Commands) -> None:
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
