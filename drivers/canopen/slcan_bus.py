"""An slcan adapter whose damaged lines are dropped and counted instead of ending the reader.

slcan has no checksum: a line whose digits were exchanged for other digits is a frame like others.
What can be noticed is noticed: a line must be as long as it says, of the signs that it may have.
"""

import re
from collections.abc import Callable
from typing import Any

import can
from can.interfaces.slcan import slcanBus

LONGEST_LINE = 512
FD_BYTES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
HEAD = re.compile(r"(?:([tdbr])[0-9A-Fa-f]{3}|([TxDBR])[0-9A-Fa-f]{8})([0-9A-Fa-f])")
REST = re.compile(r"[0-9A-Fa-f]*")
ANSWER = re.compile(r"[zZ]?|[VvNF][0-9A-Za-z]{0,8}")
TIMESTAMP_SIGNS = 4


def is_whole(line: str) -> bool:
    """Whether a line (without its end) is a frame or an answer as the adapter's manual has them."""
    head = HEAD.match(line)
    if head is None:
        return ANSWER.fullmatch(line) is not None
    kind, size = (head[1] or head[2]), int(head[3], 16)
    fd = kind in "dDbB"
    if not fd and size > 8:
        return False
    signs = 0 if kind in "rR" else 2 * FD_BYTES[size]
    rest = line[head.end() :]
    return REST.fullmatch(rest) is not None and len(rest) in (signs, signs + TIMESTAMP_SIGNS)


class SlcanBus(slcanBus):
    """The adapter; ``on_damaged`` is called in the reading thread for every line dropped."""

    def __init__(self, on_damaged: Callable[[str], None], **options: Any) -> None:
        self._on_damaged = on_damaged
        super().__init__(**options)

    def _read(self, timeout: float | None) -> str | None:
        try:
            line = super()._read(timeout)
        except can.CanOperationError as error:
            if not isinstance(error.__cause__, UnicodeDecodeError):
                raise
            self._drop()
            return None
        if line is None:
            if len(self._buffer) > LONGEST_LINE:
                self._drop()
            return None
        if line == "\a" or (line.endswith("\r") and is_whole(line[:-1])):
            return line
        self._on_damaged(f"an slcan line {line[:40]!r}")
        return None

    def _drop(self) -> None:
        text = bytes(self._buffer[:40])
        self._buffer.clear()
        self._on_damaged(f"an slcan line {text!r}")


def open_bus(options: dict[str, Any], on_damaged: Callable[[str], None]) -> can.BusABC:
    """Open the bus that python-can's keyword arguments ``options`` name; raises what it raises."""
    if options["interface"] != "slcan":
        return can.Bus(**options)
    return SlcanBus(on_damaged, **{k: v for k, v in options.items() if k != "interface"})
