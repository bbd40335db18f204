"""Laws of trackers."""

import asyncio
import math
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager

from drivers.contract.bench import Law, TrackerBench, hold, refuses
from drivers.errors import DeviceError, LinkError, MeasurementError, Refused
from drivers.interface import Tracker, TrackerCan, TrackerReading

CHANNELS = {
    "structure_temp_C": "object_temperature",
    "air_temp_C": "weather",
    "pressure_hPa": "weather",
    "humidity": "weather",
}
DWELL_S = 0.5
SAMPLES = 5
SIGMAS = 12.0
"""Two readings of an SMR that stands differ by less than so many of their sigmas."""
NEAR_MM = 1.0


@asynccontextmanager
async def _connected(bench: TrackerBench) -> AsyncIterator[Tracker]:
    """A driver that is initialised, with its beam on the SMR."""
    async with asyncio.timeout(bench.longest_s):
        tracker = await bench.open()
    try:
        await tracker.initialize()
        if tracker.can.points and bench.target is not None:
            await tracker.point_at(await bench.target())
        yield tracker
    finally:
        async with asyncio.timeout(bench.longest_s):
            await tracker.close()


async def _measured(tracker: Tracker, bench: TrackerBench) -> TrackerReading:
    async with asyncio.timeout(bench.longest_s):
        return await tracker.measure(DWELL_S)


def _apart(one: TrackerReading, two: TrackerReading) -> tuple[float, float]:
    """Distance of two readings, and what their noise allows, mm."""
    variance = sum(one.covariance[:3]) + sum(two.covariance[:3])
    return math.dist(one.xyz, two.xyz), SIGMAS * math.sqrt(variance)


async def _says_who_it_is(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        hold(bool(tracker.identity.kind), "its identity has no kind")
        hold(isinstance(tracker.can, TrackerCan), "it does not say what it can")
        tracker.check()
        state = await tracker.state()
        hold(state.initialized, "after initialize() it says that it is not initialised")
        hold(tracker.can.faces == (state.face in (1, 2)), f"its face is {state.face}")


async def _measures(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        one, two = await _measured(tracker, bench), await _measured(tracker, bench)
        for reading in (one, two):
            hold(all(map(math.isfinite, reading.xyz)), f"a reading is {reading.xyz}")
            xx, yy, zz, xy, xz, yz = reading.covariance
            minors = (xx, xx * yy - xy**2)
            whole = xx * (yy * zz - yz**2) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
            hold(min(*minors, whole) > 0.0, f"covariance {reading.covariance} is not positive")
        distance, allowed = _apart(one, two)
        hold(distance < allowed, f"two readings of one SMR are {distance:g} mm apart")
        weather = (one.temperature_C, one.pressure_hPa, one.humidity)
        hold(
            tracker.can.weather or weather == (None, None, None),
            "it has no weather station and states the weather all the same",
        )


async def _points(bench: TrackerBench) -> None:
    assert bench.target is not None
    async with _connected(bench) as tracker:
        target = await bench.target()
        await tracker.point_at(target)
        distance = math.dist((await _measured(tracker, bench)).xyz, target)
        hold(distance < NEAR_MM, f"pointed at the SMR it measures {distance:g} mm beside")
        away = (target[0], target[1], target[2] + 2.0 * math.dist(target, (0.0, 0.0, 0.0)))
        error = await refuses(tracker.point_at(away), bench.longest_s, "pointing at nothing")
        hold(isinstance(error, MeasurementError), f"pointing at nothing ends in {error!r}")


async def _streams(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        times: list[float] = []
        async with asyncio.timeout(bench.longest_s):
            samples = tracker.stream(0.05)
            async for sample in samples:
                times.append(sample.time_s)
                hold(all(map(math.isfinite, sample.xyz)), f"a sample is {sample.xyz}")
                if len(times) == SAMPLES:
                    break
            if isinstance(samples, AsyncGenerator):
                await samples.aclose()
        hold(times == sorted(set(times)), f"times of samples: {times}")
        await _measured(tracker, bench)


async def _changes_face(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        before, one = (await tracker.state()).face, await _measured(tracker, bench)
        await tracker.change_face()
        hold((await tracker.state()).face == 3 - before, "change_face() leaves the face as it was")
        await tracker.change_face()
        distance, allowed = _apart(one, await _measured(tracker, bench))
        hold(distance < allowed, f"after two changes of face the SMR is {distance:g} mm away")


async def _refuses_reflectors(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        error = await refuses(
            tracker.select_reflector("no such reflector"), bench.longest_s, "an unknown reflector"
        )
        hold(isinstance(error, Refused), f"an unknown reflector ends in {error!r}")


async def _states_only_what_it_measures(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        for name, value in (await tracker.channels()).items():
            hold(math.isfinite(value), f"the channel {name} is {value}")
            needs = CHANNELS.get(name, "")
            hold(
                not needs or getattr(tracker.can, needs),
                f"it has the channel {name} and says that it cannot: {needs}",
            )


async def _stops(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        async with asyncio.timeout(bench.longest_s):
            await tracker.stop()
            await tracker.stop()
        dwell = asyncio.ensure_future(tracker.measure(3600.0))
        await asyncio.sleep(0.2)
        async with asyncio.timeout(bench.longest_s):
            await tracker.stop()
        await refuses(dwell, bench.longest_s, "a dwell that was stopped")
        await _measured(tracker, bench)


async def _loses_the_beam(bench: TrackerBench) -> None:
    assert bench.hide is not None
    async with _connected(bench) as tracker:
        await bench.hide()
        error = await refuses(tracker.measure(DWELL_S), bench.longest_s, "a dwell without a beam")
        hold(isinstance(error, MeasurementError), f"a dwell without a beam ends in {error!r}")


async def _notices_silence(bench: TrackerBench) -> None:
    assert bench.silence is not None
    async with _connected(bench) as tracker:
        await bench.silence()
        error = await refuses(tracker.measure(DWELL_S), bench.longest_s, "a silent device")
        hold(isinstance(error, LinkError | MeasurementError), f"a silent device ends in {error!r}")


async def _closes(bench: TrackerBench) -> None:
    async with _connected(bench) as tracker:
        async with asyncio.timeout(bench.longest_s):
            await tracker.close()
            await tracker.close()
        error = await refuses(tracker.measure(DWELL_S), bench.longest_s, "a dwell after the end")
        hold(isinstance(error, DeviceError), f"a dwell after the end ends in {error!r}")


TRACKER_LAWS: tuple[Law[TrackerBench], ...] = (
    Law("it says who it is and what it can", _says_who_it_is),
    Law("readings are numbers with a true covariance, and agree", _measures),
    Law("it points at an SMR, and says when there is none", _points, ("points", "target")),
    Law("samples come in order, and a dwell can follow them", _streams, ("streams",)),
    Law("it changes its face and back", _changes_face, ("faces",)),
    Law("it refuses a reflector that it does not know", _refuses_reflectors, ("reflectors",)),
    Law("channels are only what it measures", _states_only_what_it_measures),
    Law("a stop ends a dwell at once", _stops),
    Law("without a beam there is an error, no reading", _loses_the_beam, ("hide",)),
    Law("silence is a fault before a deadline", _notices_silence, ("silence",)),
    Law("after the end nothing answers, nothing hangs", _closes),
)
