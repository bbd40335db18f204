"""An instrument of lines: it cannot be told where to look, only be listened to, or asked."""

import asyncio
import math
import statistics
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from drivers.errors import BeamBroken, DeviceError, LinkLost, NotReady, Refused, Silence
from drivers.interface import (
    Alarm,
    Identity,
    TrackerCan,
    TrackerReading,
    TrackerState,
    TrackSample,
)
from drivers.lines.reading import LinePattern, Reading
from drivers.lines.source import REMEDY, Source

LEAST_SAMPLES = 3
"""Lines of a stream that make a dwell at least."""
STRAY, STRAY_MM = 30.0, 0.1
"""A line so many times farther from the others of its dwell than these among themselves, and by so
much in any case, has lost a digit on its way, or was taken while somebody touched the SMR."""


@dataclass(frozen=True)
class LineSettings:
    """How an instrument of lines is used.

    Attributes
    ----------
    sigma_mm : float
        Standard uncertainty of a reading per axis, where lines state none.
    stream : bool
        Lines come all the time, and a reading is the mean of a dwell; else each line is a reading,
        made by itself (a key is pressed) or asked for.
    ask : str
        What is sent for a reading; "" for nothing.
    silence_s : float
        Seconds without a line that are a fault: of a stream at any time, else of a reading.
    """

    sigma_mm: float
    stream: bool
    ask: str
    silence_s: float


class LineTracker:
    """An instrument that sends lines (implements :class:`drivers.interface.Tracker`)."""

    def __init__(
        self, source: Source, pattern: LinePattern, settings: LineSettings, device: str,
        time_scale: float = 1.0,
    ) -> None:  # fmt: skip
        self.identity = Identity("lines")
        self.can = TrackerCan(streams=settings.stream)
        self._source, self._pattern, self._settings = source, pattern, settings
        self._device, self._scale = device, time_scale
        self._alarms: list[Callable[[Alarm], None]] = []
        self._lost: DeviceError | None = None
        self._locked = not settings.stream
        self._listeners: set[asyncio.Queue[Reading | DeviceError]] = set()
        self._task = asyncio.ensure_future(self._listen())

    async def first_line(self) -> None:
        """Wait for a stream to begin; raises Silence, LinkLost."""
        if self._settings.stream:
            with self._queue() as heard:
                said = await heard.get()
            if isinstance(said, DeviceError) and not isinstance(said, BeamBroken):
                raise said

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for everything said unasked."""
        self._alarms.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing."""
        if self._lost is not None:
            raise self._lost

    async def state(self) -> TrackerState:
        """What is known of it: whether lines come, and hold readings."""
        self.check()
        return TrackerState(True, self._locked, self._locked, True, "", 0)

    async def initialize(self) -> None:
        """Nothing can be set; raises the fault that stands."""
        self.check()

    async def measure(self, dwell_s: float) -> TrackerReading:
        """A reading: the mean of the lines of a dwell, or the next line that is one.

        Raises
        ------
        BeamBroken
            For a line that holds no reading.
        NotReady
            For a line of a dwell that is far from the others.
        Silence, LinkLost
        """
        with self._queue() as heard:
            if self._settings.ask:
                await self._source.send(self._settings.ask)
            if self._settings.stream:
                samples = await self._dwell(heard, dwell_s / self._scale)
                self._must_agree(samples)
                return self._mean(samples)
            said = await self._next(heard)
        return self._mean([said])

    async def _dwell(
        self, heard: "asyncio.Queue[Reading | DeviceError]", wall_s: float
    ) -> list[Reading]:
        loop = asyncio.get_running_loop()
        end = loop.time() + wall_s
        samples: list[Reading] = []
        while loop.time() < end or len(samples) < LEAST_SAMPLES:
            samples.append(await self._next(heard))
        return samples

    def _must_agree(self, samples: list[Reading]) -> None:
        centre = [statistics.median(one.xyz[axis] for one in samples) for axis in range(3)]
        off = [math.dist(one.xyz, centre) for one in samples]
        usual = max(statistics.median(off), self._settings.sigma_mm)
        if max(off) > max(STRAY * usual, STRAY_MM):
            raise NotReady(
                f"one of the {len(samples)} lines of a dwell is {max(off):.3g} mm from the others",
                device=self._device,
                remedy="Keep off the SMR; check the cable, these lines have no checksum",
            )

    def _mean(self, samples: list[Reading]) -> TrackerReading:
        """Mean of samples; lines that state their uncertainty state it of what does not average."""
        x, y, z = (statistics.fmean(one.xyz[axis] for one in samples) for axis in range(3))
        stated = [one.sigma for one in samples if one.sigma is not None]
        xx, yy, zz = (
            statistics.fmean(one[axis] for one in stated) ** 2
            if stated
            else self._settings.sigma_mm**2
            for axis in range(3)
        )
        return TrackerReading((x, y, z), (xx, yy, zz, 0.0, 0.0, 0.0))

    async def stream(self, separation_s: float) -> AsyncIterator[TrackSample]:
        """Samples as they come, none closer than ``separation_s``."""
        loop = asyncio.get_running_loop()
        latest = -math.inf
        with self._queue() as heard:
            while True:
                reading = await self._next(heard)
                now = loop.time() * self._scale
                if now - latest >= separation_s:
                    latest = now
                    yield TrackSample(now, reading.xyz, True)

    async def channels(self) -> dict[str, float]:
        """It measures nothing else."""
        self.check()
        return {}

    async def stop(self) -> None:
        """End a dwell."""
        self._tell(BeamBroken("stopped by the operator", device=self._device))

    async def close(self) -> None:
        """Release the link; never raises."""
        self._fail(LinkLost("the connection was closed", device=self._device), say=False)
        self._task.cancel()
        await asyncio.wait([self._task], timeout=1.0)
        await self._source.close()

    async def select_reflector(self, name: str) -> None:
        """It knows no reflectors."""
        raise self._cannot("choose a reflector")

    async def point_at(self, xyz: tuple[float, float, float]) -> None:
        """It has no drives."""
        raise self._cannot("be pointed")

    async def find_reflector(self, distance_mm: float) -> None:
        """It has no drives."""
        raise self._cannot("search")

    async def change_face(self) -> None:
        """It has one face."""
        raise self._cannot("change its face")

    def _cannot(self, what: str) -> Refused:
        return Refused(f"an instrument that only sends lines cannot {what}", device=self._device)

    # ------------------------------------------------------------ lines

    async def _listen(self) -> None:
        lines = self._source.lines()
        longest = self._settings.silence_s if self._settings.stream else None
        try:
            while True:
                async with asyncio.timeout(longest):
                    line = await anext(lines)
                if self._pattern.ignores(line):
                    continue
                reading = self._pattern.read(line)
                self._locked = reading is not None or not self._settings.stream
                self._tell(reading or self._none_in(line))
        except TimeoutError:
            self._fail(self._silence())
        except (DeviceError, StopAsyncIteration) as error:
            lost = LinkLost("no more lines come", device=self._device, remedy=REMEDY)
            self._fail(error if isinstance(error, DeviceError) else lost)

    def _silence(self) -> Silence:
        return Silence(
            f"no line for {self._settings.silence_s:g} s", device=self._device, remedy=REMEDY
        )

    def _none_in(self, line: str) -> BeamBroken:
        shown = line if len(line) <= 60 else f"{line[:57]}..."
        return BeamBroken(
            f"the line {shown!r} holds no reading",
            device=self._device,
            remedy="The SMR is out of the beam, or pattern in the site file does not fit the lines",
        )

    @contextmanager
    def _queue(self) -> "Iterator[asyncio.Queue[Reading | DeviceError]]":
        """What is heard from now on."""
        self.check()
        heard: asyncio.Queue[Reading | DeviceError] = asyncio.Queue()
        self._listeners.add(heard)
        try:
            yield heard
        finally:
            self._listeners.discard(heard)

    async def _next(self, heard: "asyncio.Queue[Reading | DeviceError]") -> Reading:
        """The next reading; raises what was heard instead of one, and Silence."""
        try:
            async with asyncio.timeout(self._settings.silence_s):
                said = await heard.get()
        except TimeoutError:
            raise self._silence() from None
        if isinstance(said, DeviceError):
            raise said
        return said

    def _tell(self, said: "Reading | DeviceError") -> None:
        for heard in self._listeners:
            heard.put_nowait(said)

    def _fail(self, error: DeviceError, say: bool = True) -> None:
        if self._lost is None:
            self._lost, self._locked = error, False
            self._tell(error)
            for callback in self._alarms if say else ():
                callback(Alarm(self._device, error.what, error.remedy, fault=True))
