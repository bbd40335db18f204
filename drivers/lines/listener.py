"""Lines as they come, told to whoever waits for one; what stands against it once they end."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

from drivers.errors import DeviceError, LinkLost, Silence
from drivers.interface import Alarm
from drivers.lines.source import REMEDY, Source

Heard = TypeVar("Heard")


class Listener(Generic[Heard]):
    """Reads lines of a source for ever, in a task of its own.

    Parameters
    ----------
    source : Source
    read : function
        What a line says: a reading, an error where it holds none, None where it says nothing.
    silence_s : float
        Seconds without a line that are a fault.
    always : bool
        Whether that holds at any time (a stream), or only while somebody waits for a line.
    device : str
        What it is called in messages.
    """

    def __init__(
        self, source: Source, read: "Callable[[str], Heard | DeviceError | None]",
        silence_s: float, always: bool, device: str,
    ) -> None:  # fmt: skip
        self._source, self._read, self._device = source, read, device
        self._silence_s, self._always = silence_s, always
        self._alarms: list[Callable[[Alarm], None]] = []
        self._lost: DeviceError | None = None
        self._listeners: set[asyncio.Queue[Heard | DeviceError]] = set()
        self._task = asyncio.ensure_future(self._listen())

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for everything said unasked."""
        self._alarms.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing."""
        if self._lost is not None:
            raise self._lost

    async def ask(self, text: str) -> None:
        """Send text, if there is any."""
        if text:
            await self._source.send(text)

    @contextmanager
    def queue(self) -> "Iterator[asyncio.Queue[Heard | DeviceError]]":
        """What is heard from now on."""
        self.check()
        heard: asyncio.Queue[Heard | DeviceError] = asyncio.Queue()
        self._listeners.add(heard)
        try:
            yield heard
        finally:
            self._listeners.discard(heard)

    async def next(self, heard: "asyncio.Queue[Heard | DeviceError]") -> Heard:
        """The next reading; raises what was heard instead of one, and Silence."""
        try:
            async with asyncio.timeout(self._silence_s):
                said = await heard.get()
        except TimeoutError:
            raise self._silence() from None
        if isinstance(said, DeviceError):
            raise said
        return said

    def tell(self, said: "Heard | DeviceError") -> None:
        """Tell whoever waits."""
        for heard in self._listeners:
            heard.put_nowait(said)

    def say(self, alarm: Alarm) -> None:
        """Say something unasked."""
        for callback in self._alarms:
            callback(alarm)

    async def close(self) -> None:
        """Release the link; never raises."""
        closed = "the connection was closed"
        self._fail(LinkLost(closed, device=self._device, remedy="Connect again."), say=False)
        self._task.cancel()
        await asyncio.wait([self._task], timeout=1.0)
        await self._source.close()

    async def _listen(self) -> None:
        lines = self._source.lines()
        longest = self._silence_s if self._always else None
        try:
            while True:
                async with asyncio.timeout(longest):
                    line = await anext(lines)
                if (said := self._read(line)) is not None:
                    self.tell(said)
        except TimeoutError:
            self._fail(self._silence())
        except (DeviceError, StopAsyncIteration) as error:
            lost = LinkLost("no more lines come", device=self._device, remedy=REMEDY)
            self._fail(error if isinstance(error, DeviceError) else lost)

    def _silence(self) -> Silence:
        return Silence(f"no line for {self._silence_s:g} s", device=self._device, remedy=REMEDY)

    def _fail(self, error: DeviceError, say: bool = True) -> None:
        if self._lost is None:
            self._lost = error
            self.tell(error)
            if say:
                self.say(Alarm(self._device, error.what, error.remedy, fault=True))
