"""Streams that outlive their terminal: a laptop that is closed ends no measurement, and no stop."""

import os
from collections.abc import Iterable
from contextlib import suppress
from typing import Any, TextIO


class Lasting:
    """A stream that goes on when its terminal is gone: what is written then is lost.

    A write can meet the closed terminal before its signal is heard; the stop that the signal asks
    for must not end in that write.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or lose it."""
        try:
            return self._stream.write(text)
        except OSError:
            self._leave()
            return len(text)

    def flush(self) -> None:
        """Bring it out, or lose it."""
        try:
            self._stream.flush()
        except OSError:
            self._leave()

    def _leave(self) -> None:
        with suppress(OSError):
            write_to_nobody([self._stream.fileno()])


def write_to_nobody(terminals: Iterable[int]) -> None:
    """Nobody reads a terminal that is gone, and writing to it would end the stop half-way."""
    nobody = os.open(os.devnull, os.O_RDWR)
    for descriptor in terminals:
        with suppress(OSError):
            os.dup2(nobody, descriptor)
    os.close(nobody)
