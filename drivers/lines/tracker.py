"""An instrument of lines: it cannot be told where to look, only be listened to, or asked."""

import asyncio
import math
import statistics
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass

from drivers.errors import BeamBroken, DeviceError, NotReady, Refused
from drivers.interface import (
    Alarm,
    Identity,
    TrackerCan,
    TrackerReading,
    TrackerState,
    TrackSample,
)
from drivers.lines.listener import Listener
from drivers.lines.reading import LinePattern, Reading
from drivers.lines.source import Source
from drivers.stopping import stopped

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
        self._pattern, self._settings = pattern, settings
        self._device, self._scale = device, time_scale
        self._locked = not settings.stream
        self._lines: Listener[Reading] = Listener(
            source, self._read, settings.silence_s, settings.stream, device
        )

    async def first_line(self) -> None:
        """Wait for a stream to begin; raises Silence, LinkLost."""
        if self._settings.stream:
            with self._lines.queue() as heard:
                said = await heard.get()
            if isinstance(said, DeviceError) and not isinstance(said, BeamBroken):
                raise said

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for everything said unasked."""
        self._lines.on_alarm(callback)

    def check(self) -> None:
        """Raise the fault that is standing."""
        try:
            self._lines.check()
        except DeviceError:
            self._locked = False
            raise

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
        with self._lines.queue() as heard:
            await self._lines.ask(self._settings.ask)
            if self._settings.stream:
                samples = await self._dwell(heard, dwell_s / self._scale)
                self._must_agree(samples)
                return self._mean(samples)
            said = await self._lines.next(heard)
        return self._mean([said])

    async def _dwell(
        self, heard: "asyncio.Queue[Reading | DeviceError]", wall_s: float
    ) -> list[Reading]:
        loop = asyncio.get_running_loop()
        end = loop.time() + wall_s
        samples: list[Reading] = []
        while loop.time() < end or len(samples) < LEAST_SAMPLES:
            samples.append(await self._lines.next(heard))
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
        with self._lines.queue() as heard:
            while True:
                reading = await self._lines.next(heard)
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
        self._lines.tell(stopped(BeamBroken, self._device))

    async def close(self) -> None:
        """Release the link; never raises."""
        await self._lines.close()

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
        return Refused(
            f"an instrument that only sends lines cannot {what}",
            device=self._device,
            remedy="Do it by hand.",
        )

    def _read(self, line: str) -> Reading | DeviceError | None:
        """What a line says: a reading, that there was none, or nothing."""
        if self._pattern.ignores(line):
            return None
        reading = self._pattern.read(line)
        self._locked = reading is not None or not self._settings.stream
        return reading or self._none_in(line)

    def _none_in(self, line: str) -> BeamBroken:
        shown = line if len(line) <= 60 else f"{line[:57]}..."
        return BeamBroken(
            f"the line {shown!r} holds no reading",
            device=self._device,
            remedy="The SMR is out of the beam, or pattern in the site file does not fit the lines",
        )
