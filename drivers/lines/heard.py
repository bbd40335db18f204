"""What instruments share that send lines and are read one value at a time."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from drivers.errors import DeviceError, LinkError, NoNumber
from drivers.interface import Alarm, GaugeState
from drivers.lines.listener import Listener
from drivers.lines.source import Source
from drivers.stopping import stopped

LONGEST_SHOWN = 60
Said = TypeVar("Said")
Value_co = TypeVar("Value_co", covariant=True)


class Pattern(Protocol[Value_co]):
    """What the lines of an instrument look like."""

    def ignores(self, line: str) -> bool:
        """Whether a line says nothing."""
        ...

    def read(self, line: str) -> Value_co | None:
        """What a line says; None where it should say something and does not."""
        ...


class Heard(ABC, Generic[Said]):
    """A listener, and the part of :class:`drivers.interface.Gauge` that hangs on nothing else.

    Parameters
    ----------
    source : Source
    pattern : Pattern
    silence_s : float
        Seconds without a line that are a fault.
    stream : bool
        Whether lines come all the time.
    device : str
        Its name in messages.
    """

    def __init__(
        self, source: Source, pattern: Pattern[object], silence_s: float, stream: bool, device: str
    ) -> None:
        self._pattern, self._device, self._last = pattern, device, ""
        self._lines: Listener[Said] = Listener(source, self._read, silence_s, stream, device)

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for everything said unasked."""
        self._lines.on_alarm(callback)

    def check(self) -> None:
        """Raise the fault that is standing."""
        self._lines.check()

    async def state(self) -> GaugeState:
        """Whether its last line said what it should."""
        self.check()
        return GaugeState(self._pattern.read(self._last) is not None, self._last)

    async def stop(self) -> None:
        """End a reading that is waited for."""
        self._lines.tell(stopped(LinkError, self._device))

    async def close(self) -> None:
        """Release the link; never raises."""
        await self._lines.close()

    def _read(self, line: str) -> "Said | DeviceError | None":
        """What a line says, that it did not say what it should, or nothing."""
        if self._pattern.ignores(line):
            return None
        self._last = line.strip()
        return self._said(line)

    @abstractmethod
    def _said(self, line: str) -> "Said | DeviceError":
        """The same of a line that is not ignored."""

    def _nothing_in(self, line: str, lacks: str, remedy: str) -> NoNumber:
        shown = line.strip()
        shown = shown if len(shown) <= LONGEST_SHOWN else f"{shown[: LONGEST_SHOWN - 3]}..."
        return NoNumber(f"the line {shown!r} {lacks}", device=self._device, remedy=remedy)
