"""A driver for instruments that send ``x y z`` lines: where their SMR is, in mm, on TCP.

A line that holds no three numbers means that the SMR is out of the beam.
"""

import asyncio
import math
import statistics
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Any

from drivers.errors import BeamBroken, ConnectFailed, DeviceError, LinkLost, Silence
from drivers.interface import (
    Alarm,
    Identity,
    Tracker,
    TrackerCan,
    TrackerReading,
    TrackerState,
    TrackSample,
)
from drivers.kind import Kind, Setting, Surroundings

Point = tuple[float, float, float]
LEAST_SAMPLES = 8
REMEDY = "Check the instrument, its cable and its address, then connect again."


class LineTracker:
    """An instrument that cannot be told anything (implements ``drivers.interface.Tracker``)."""

    def __init__(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        device: str,
        sigma_mm: float,
        silence_s: float,
        time_scale: float,
    ) -> None:
        self.identity = Identity("line-stream")
        self.can = TrackerCan(streams=True)
        self._writer = writer
        self._device = device
        self._variance = sigma_mm**2
        self._silence_s = silence_s
        self._scale = time_scale
        self._alarms: list[Callable[[Alarm], None]] = []
        self._lost: DeviceError | None = None
        self._locked = False
        self._listeners: set[asyncio.Queue[Point | DeviceError]] = set()
        self._task = asyncio.ensure_future(self._listen(reader))

    @classmethod
    async def connect(cls, around: Surroundings) -> "LineTracker":
        """Connect and wait for a first line; raises ConnectFailed, Silence."""
        settings = around.settings
        host, port = settings["address"].rsplit(":", 1)
        device = f"tracker {settings['address']}"
        try:
            async with asyncio.timeout(5.0):
                reader, writer = await asyncio.open_connection(host, int(port))
        except (OSError, TimeoutError) as error:
            raise ConnectFailed(
                f"nobody answers ({error or 'no answer'})", device=device, remedy=REMEDY
            ) from error
        tracker = cls(
            reader,
            writer,
            device,
            settings["sigma_mm"],
            settings["silence_s"],
            around.time_scale,
        )
        try:
            with tracker._queue() as lines:
                await tracker._next(lines, beam=False)
        except DeviceError:
            await tracker.close()
            raise
        return tracker

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for everything said unasked."""
        self._alarms.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing."""
        if self._lost is not None:
            raise self._lost

    async def state(self) -> TrackerState:
        """What is known of it: whether lines come, and hold numbers."""
        self.check()
        return TrackerState(True, self._locked, self._locked, True, "", 0)

    async def initialize(self) -> None:
        """Nothing can be set; raises the fault that stands."""
        self.check()

    async def measure(self, dwell_s: float) -> TrackerReading:
        """Mean of the samples of ``dwell_s``; its uncertainty is the one that the site states."""
        wall = dwell_s / self._scale
        loop = asyncio.get_running_loop()
        samples: list[Point] = []
        with self._queue() as lines:
            end = loop.time() + wall
            while loop.time() < end or len(samples) < LEAST_SAMPLES:
                samples.append(await self._next(lines))
        x, y, z = (statistics.fmean(values) for values in zip(*samples, strict=True))
        v = self._variance
        return TrackerReading((x, y, z), (v, v, v, 0.0, 0.0, 0.0))

    async def stream(self, separation_s: float) -> AsyncIterator[TrackSample]:
        """Samples as they come, none closer than ``separation_s``."""
        loop = asyncio.get_running_loop()
        latest = -math.inf
        with self._queue() as lines:
            while True:
                xyz = await self._next(lines)
                now = loop.time() * self._scale
                if now - latest >= separation_s:
                    latest = now
                    yield TrackSample(now, xyz, True)

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
        self._writer.close()

    # What it cannot do is never called: see ``can``.

    async def select_reflector(self, name: str) -> None:
        """It knows no reflectors."""

    async def point_at(self, xyz: Point) -> None:
        """It has no drives."""

    async def find_reflector(self, distance_mm: float) -> None:
        """It has no drives."""

    async def change_face(self) -> None:
        """It has one face."""

    # ------------------------------------------------------------ lines

    async def _listen(self, reader: asyncio.StreamReader) -> None:
        try:
            while True:
                try:
                    async with asyncio.timeout(self._silence_s):
                        line = await reader.readline()
                except TimeoutError:
                    what = f"no line for {self._silence_s:g} s"
                    self._fail(Silence(what, device=self._device, remedy=REMEDY))
                    return
                if not line:
                    raise OSError("the instrument closed the connection")
                xyz = _point(line)
                self._locked = xyz is not None
                lost = BeamBroken("the SMR is out of the beam", device=self._device)
                self._tell(lost if xyz is None else xyz)
        except (OSError, ValueError) as error:  # ValueError: a line without an end
            self._fail(LinkLost(str(error), device=self._device, remedy=REMEDY))

    def _queue(self) -> "_Listening":
        self.check()
        return _Listening(self._listeners)

    async def _next(self, lines: "asyncio.Queue[Point | DeviceError]", beam: bool = True) -> Point:
        """The next sample; a lost beam is an error, or nowhere if ``beam`` is False."""
        said = await lines.get()  # _listen has the deadline, and tells of it
        if isinstance(said, BeamBroken) and not beam:
            return (math.nan, math.nan, math.nan)
        if isinstance(said, DeviceError):
            raise said
        return said

    def _tell(self, said: "Point | DeviceError") -> None:
        for queue in self._listeners:
            queue.put_nowait(said)

    def _fail(self, error: DeviceError, say: bool = True) -> None:
        if self._lost is None:
            self._lost, self._locked = error, False
            self._tell(error)
            for callback in self._alarms if say else ():
                callback(Alarm(self._device, error.what, error.remedy, fault=True))


class _Listening:
    """A queue of lines, as long as somebody listens."""

    def __init__(self, listeners: "set[asyncio.Queue[Point | DeviceError]]") -> None:
        self._listeners = listeners
        self._queue: asyncio.Queue[Point | DeviceError] = asyncio.Queue()

    def __enter__(self) -> "asyncio.Queue[Point | DeviceError]":
        self._listeners.add(self._queue)
        return self._queue

    def __exit__(self, *_: object) -> None:
        self._listeners.discard(self._queue)


def _point(line: bytes) -> Point | None:
    try:
        x, y, z = (float(word) for word in line.split())
    except ValueError:
        return None
    return (x, y, z) if all(map(math.isfinite, (x, y, z))) else None


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["address"])


KIND: Kind[Tracker] = Kind(
    says="Any instrument or program that sends x y z lines (mm) on TCP",
    settings=(
        Setting("address", "address", "host:port of the stream"),
        Setting("sigma_mm", "number", "standard uncertainty of a reading, mm per axis", least=1e-6),
        Setting("silence_s", "number", "seconds without a line that are a fault", 2.0, least=0.1),
    ),
    open=LineTracker.connect,
    address=_address,
)
