"""A probe that touches or does not: what its lines say, one question at a time."""

import re
from collections.abc import Callable

from drivers.errors import DeviceError, LinkError, NoNumber
from drivers.interface import Alarm, GaugeCan, GaugeReading, GaugeState, Identity
from drivers.lines.listener import Listener
from drivers.lines.patience import LONGEST
from drivers.lines.source import Source
from drivers.stopping import stopped

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


class ContactProbe:
    """A touch-trigger probe or an electric contact (a :class:`drivers.interface.Gauge`).

    ``ask`` is sent before each reading; where it is empty the probe speaks by itself, and the
    next line counts.
    """

    def __init__(
        self, source: Source, pattern: ContactPattern, ask: str, silence_s: float, device: str
    ) -> None:
        self.identity = Identity("contact")
        self.can = GaugeCan(contacts=True)
        self._pattern, self._ask, self._device = pattern, ask, device
        self._last = ""
        self._lines: Listener[GaugeReading] = Listener(
            source, self._read, silence_s, not ask, device
        )

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for everything said unasked."""
        self._lines.on_alarm(callback)

    def check(self) -> None:
        """Raise the fault that is standing."""
        self._lines.check()

    async def state(self) -> GaugeState:
        """Whether its last line said one of both."""
        self.check()
        return GaugeState(self._pattern.read(self._last) is not None, self._last)

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

    async def stop(self) -> None:
        """End a reading that is waited for."""
        self._lines.tell(stopped(LinkError, self._device))

    async def close(self) -> None:
        """Release the link; never raises."""
        await self._lines.close()

    def _read(self, line: str) -> "GaugeReading | DeviceError | None":
        if self._pattern.ignores(line):
            return None
        self._last = line.strip()
        value = self._pattern.read(line)
        if value is not None:
            return GaugeReading(value, self._last)
        shown = self._last if len(self._last) <= 60 else f"{self._last[:57]}..."
        return NoNumber(
            f"the line {shown!r} says neither that it touches nor that it does not",
            device=self._device,
            remedy="See touches, open and ignore in the site file, and the cable",
        )
