"""The beam: aim, settle, measure, and get it back when it was lost."""

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager

import numpy as np

from app.errors import StoppedByOperator
from app.files.pose_table import HOME
from app.session.events import LiveScatter
from app.session.routines.watching import check_alive
from app.session.work import Work
from drivers.errors import BeamBroken, DeviceError, MeasurementError, NoTarget, NotReady
from drivers.interface import TrackerReading, TrackSample

_SAMPLE_S = 0.05
_SAMPLES_PER_WALL_S = 2500.0
"""A fast clock must not flood the wire."""
_RELOCK_TRIES = 4
_LEAST_READINGS = 4
"""Readings that are compared before settling is given up, however long they took."""
_SPARE_S = 5.0
"""Wall seconds beyond the tracker's own time after which settling is given up."""
_RELOCK_WAIT_S = 0.5
"""Wall seconds between tries to find the reflector again."""
_TRIES = 4


async def choose_reflector(work: Work) -> None:
    """Choose the site's reflector, where the tracker lets itself be told."""
    wanted = work.site.tracker.reflector
    if wanted and work.tracker.can.reflectors:
        await work.tracker.select_reflector(wanted)


async def aim(work: Work, nest: str) -> None:
    """Bring the beam to a nest, by its predicted place; raises NoTarget.

    While one SMR is followed from pose to pose the beam is there already. Pointing would also turn
    the tracker back to its first face.
    """
    if work.memory.aimed_at == nest:
        return
    work.memory.aimed_at = ""
    if work.tracker.can.points:
        await work.tracker.point_at(_predicted(work, nest))
    else:
        await _aimed_by_hand(work, nest)
    work.memory.aimed_at = nest


def _predicted(work: Work, nest: str) -> tuple[float, float, float]:
    x, y, z = work.predict(nest, work.memory.standing_at or HOME)
    return float(x), float(y), float(z)


async def _aimed_by_hand(work: Work, nest: str) -> None:
    """Have somebody bring the beam to a nest, unless one SMR is carried there in the beam.

    Whether it is the right nest is judged by the reading itself.
    """
    if (await work.tracker.state()).locked:
        return
    text = f"Bring the tracker's beam onto the SMR in nest {nest}."
    lost = NoTarget(
        f"the beam is not on the SMR in nest {nest}", device="tracker", remedy="Bring it there"
    )
    if await work.ask(text, ("done", "stop"), None, lost) == "stop":
        raise StoppedByOperator(f"stopped when the beam was to be brought to nest {nest}")


async def settle(work: Work) -> None:
    """Watch the SMR until it stands: scatter and creep of a window below their limits.

    Once for each move: the machine does not move between two nests of one pose.
    """
    if work.memory.settled:
        return
    limits = work.limits
    if not work.tracker.can.streams:
        await _settled_by_readings(work)
        return
    # Samples that are no measurement may tell one time for ever, or stay away.
    patience = work.clock.to_wall(limits.settle_timeout_s) + _SPARE_S
    try:
        async with asyncio.timeout(patience):
            last = await _watch_stream(work)
    except TimeoutError:
        last = "; the tracker's samples were none"
    if not work.memory.settled:
        raise NotReady(
            f"the machine does not come to rest within {limits.settle_timeout_s:g} s{last}",
            device="settling",
            remedy="Look for vibration or air in the beam, or raise settle_std_mm in the site file",
        )


async def _watch_stream(work: Work) -> str:
    """Watch samples until the SMR stands or the time is over; what is to be said of the last."""
    limits, last = work.limits, ""
    separation = max(_SAMPLE_S, work.clock.scale / _SAMPLES_PER_WALL_S)
    count = max(round(limits.settle_window_s / separation), 6)
    window: deque[tuple[float, float, float]] = deque(maxlen=count)
    first: float | None = None
    async with _closing(work.tracker.stream(separation)) as samples:
        async for sample in samples:
            first = sample.time_s if first is None else first
            if sample.time_s - first > limits.settle_timeout_s:
                break
            if not sample.valid:
                window.clear()
                last = "; the tracker's last sample was no measurement"
                continue
            last = ""
            window.append(sample.xyz)
            if len(window) == count:
                scatter, creep = _scatter(window)
                settled = scatter < limits.settle_std_mm and creep < limits.settle_creep_mm
                work.tell(LiveScatter(scatter, limits.settle_std_mm, sample.xyz, settled))
                if settled:
                    work.memory.settled = True
                    break
    return last


async def _settled_by_readings(work: Work) -> None:
    """Without a continuous mode: short readings, until the last two agree."""
    limits = work.limits
    begun, before, count = work.clock.now(), None, 0
    while count < _LEAST_READINGS or work.clock.now() - begun <= limits.settle_timeout_s:
        count += 1
        reading = await work.tracker.measure(limits.settle_window_s)
        if before is not None:
            creep = float(np.linalg.norm(np.subtract(reading.xyz, before)))
            settled = creep < limits.settle_creep_mm + 2.0 * _sigma(reading)
            work.tell(LiveScatter(creep, limits.settle_creep_mm, reading.xyz, settled))
            if settled:
                work.memory.settled = True
                return
        before = reading.xyz
    raise NotReady(
        f"two readings of {limits.settle_window_s:g} s do not agree within "
        f"{limits.settle_timeout_s:g} s",
        device="settling",
        remedy="Look for vibration or air in the beam, or raise settle_creep_mm in the site file",
    )


def _sigma(reading: TrackerReading) -> float:
    return float(np.sqrt(sum(reading.covariance[:3])))


@asynccontextmanager
async def _closing(
    samples: AsyncIterator[TrackSample],
) -> AsyncIterator[AsyncIterator[TrackSample]]:
    """Let the tracker end its continuous mode before anything else is asked of it."""
    try:
        yield samples
    finally:
        if isinstance(samples, AsyncGenerator):
            await samples.aclose()


def _scatter(window: "deque[tuple[float, float, float]]") -> tuple[float, float]:
    """Standard deviation (3D) and difference of the halves' means, mm."""
    points = np.array(window)
    half = len(points) // 2
    creep = np.linalg.norm(points[half:].mean(axis=0) - points[:half].mean(axis=0))
    return float(np.sqrt(points.var(axis=0, ddof=1).sum())), float(creep)


async def measured(
    work: Work, nest: str, dwell_s: float, *, patient: bool = True
) -> tuple[TrackerReading, float]:
    """Aim at a nest and measure; when the beam is lost get it back and dwell anew.

    Returns the reading and when its dwell began, machine s. Without patience a nest where nothing
    is seen is told at once.

    Raises
    ------
    MeasurementError
        If the beam cannot be had again.
    """
    for attempt in range(1, _TRIES + 1):
        try:
            await aim(work, nest)
            await settle(work)
            begun = work.clock.now()
            reading = await work.tracker.measure(dwell_s)
            _check_finite(reading)
            check_alive(work, nest, reading)
            return reading, begun
        except (BeamBroken, NoTarget) as lost:
            if attempt == _TRIES or not patient:
                raise
            await recover(work, nest, lost)
        except NotReady as unready:
            if attempt == _TRIES:
                raise
            await _make_ready(work, unready)
    raise AssertionError("the loop returns or raises")


def _check_finite(reading: TrackerReading) -> None:
    """Refuse a reading that is no reading; raises MeasurementError."""
    numbers = np.array([*reading.xyz, *reading.covariance])
    if not np.all(np.isfinite(numbers)) or np.any(numbers[3:6] <= 0.0):
        raise NotReady(
            f"a reading with impossible numbers: {reading.xyz}, covariance {reading.covariance}",
            device="tracker",
            remedy="Initialise the tracker anew",
        )


async def recover(work: Work, nest: str, lost: DeviceError) -> None:
    """Get the beam back: wait for it, point anew, search, ask. The machine holds still.

    Unattended, the loss itself is raised when all of that fails.
    """
    work.losses += 1
    work.memory.aimed_at = ""
    work.memory.settled = False
    work.suspended(
        f"the beam is lost at nest {nest}: {lost.what}", "Clear the line of sight to the SMR"
    )
    while True:
        for _ in range(_RELOCK_TRIES):
            if await _relocked(work, nest):
                work.released(f"the beam is on nest {nest} again")
                return
            await asyncio.sleep(_RELOCK_WAIT_S)
        text = f"The beam does not come back to nest {nest}. Clear the line of sight or re-seat it."
        if await work.ask(text, ("try again", "stop"), None, lost) == "stop":
            raise StoppedByOperator(f"stopped while the beam was lost at nest {nest}")


async def _relocked(work: Work, nest: str) -> bool:
    """Point at the predicted place, then search around it; as far as the tracker can."""
    can, place = work.tracker.can, _predicted(work, nest)
    found = not can.points and (await work.tracker.state()).locked
    if can.points:
        with contextlib.suppress(NoTarget, BeamBroken):
            await work.tracker.point_at(place)
            found = True
    if not found and can.searches:
        with contextlib.suppress(MeasurementError):
            await work.tracker.find_reflector(float(np.linalg.norm(place)))
            found = True
    if found:
        work.memory.aimed_at = nest
    return found


async def _make_ready(work: Work, unready: NotReady) -> None:
    """Initialise a tracker that forgot, wait for one that is not warm or stable."""
    work.suspended(f"the tracker is not ready: {unready.what}", unready.remedy or "Wait")
    state = await work.tracker.state()
    if not state.initialized:
        await work.tracker.initialize()
        await choose_reflector(work)
    else:
        await asyncio.sleep(2.0 * _RELOCK_WAIT_S)
    work.memory.aimed_at = ""
    work.released("the tracker was asked again")
