"""A probe that touches or does not: what its lines say, one question at a time."""

import re

from drivers.errors import DeviceError
from drivers.interface import GaugeCan, GaugeReading, Identity
from drivers.lines.heard import Heard
from drivers.lines.patience import LONGEST
from drivers.lines.source import Source

TOUCHES, OPEN = 1.0, 0.0


class ContactPattern:
    """Which lines say that a probe touches, and which that it does not.

    Parameters
    ----------
    touches, opened : str
        What is found in such lines; a line in which both or neither is found says neither.
    ignore : str
        Lines in which this is found say nothing; "" for none.
    """

    def __init__(self, touches: str, opened: str, ignore: str) -> None:
        self._touches, self._open = re.compile(touches), re.compile(opened)
        self._ignore = re.compile(ignore) if ignore else None

    def ignores(self, line: str) -> bool:
        """Whether a line says nothing."""
        return not line.strip() or bool(self._ignore and self._ignore.search(line[:LONGEST]))

    def read(self, line: str) -> float | None:
        """:data:`TOUCHES`, :data:`OPEN`, or None where the line says neither."""
        text = line[:LONGEST]
        touches, opened = self._touches.search(text), self._open.search(text)
        if bool(touches) == bool(opened):
            return None
        return TOUCHES if touches else OPEN


class ContactProbe(Heard[GaugeReading]):
    """A touch-trigger probe or an electric contact (a :class:`drivers.interface.Gauge`).

    ``ask`` is sent before each reading; where it is empty the probe speaks by itself, and the
    next line counts.
    """

    def __init__(
        self, source: Source, pattern: ContactPattern, ask: str, silence_s: float, device: str
    ) -> None:
        self.identity = Identity("contact")
        self.can = GaugeCan(contacts=True)
        self._values, self._ask = pattern, ask
        super().__init__(source, pattern, silence_s, not ask, device)

    async def read(self, dwell_s: float) -> GaugeReading:
        """Whether it touches now: :data:`TOUCHES` or :data:`OPEN`; a dwell makes no difference.

        Raises
        ------
        NoNumber
            For a line that says neither.
        Silence, LinkLost
        """
        with self._lines.queue() as heard:
            await self._lines.ask(self._ask)
            return await self._lines.next(heard)

    def _said(self, line: str) -> "GaugeReading | DeviceError":
        value = self._values.read(line)
        if value is not None:
            return GaugeReading(value, self._last)
        return self._nothing_in(
            line, "says neither that it touches nor that it does not",
            "See touches, open and ignore in the site file, and the cable",
        )  # fmt: skip
