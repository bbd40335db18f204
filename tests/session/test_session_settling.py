"""When a machine stands: scatter and creep of the SMR, whatever the tracker's stream looks like."""

from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from session_mock import POSES, Heard, site_text

from app.files.site import Site, parse_site
from app.session import events as ev
from app.session.plans import PlanOptions, measure_plan
from app.session.routines.beam import settle
from app.session.session import Session
from app.session.station import Devices
from app.session.work import Work
from drivers.errors import NotReady
from drivers.interface import TrackerCan, TrackerReading, TrackSample

NOISE_MM = 0.003


class StreamingTracker:
    """Streams an SMR whose place along x is a function of time, mm and s."""

    can = TrackerCan(streams=True)

    def __init__(self, x: Callable[[float], float]) -> None:
        self._x = x
        self.last_s = 0.0
        self.given: list[tuple[float, float, float]] = []

    async def stream(self, separation_s: float) -> AsyncIterator[TrackSample]:
        noise = np.random.default_rng(7)
        for k in range(10_000):
            self.last_s = k * separation_s
            x, y, z = NOISE_MM * noise.standard_normal(3)
            self.given.append((x + self._x(self.last_s), y, z))
            yield TrackSample(self.last_s, self.given[-1], True)


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return parse_site(site_text(smrs=3), "site.toml", tmp_path)


@pytest.fixture
def work(site: Site, tmp_path: Path, heard: Heard) -> Work:
    session = Session.create(site, measure_plan(site, POSES, PlanOptions()), tmp_path)
    session.observers.watch(heard)
    return session.work


def seen_by(work: Work, tracker: StreamingTracker) -> Work:
    work.station._devices = Devices(None, tracker)  # type: ignore[arg-type]
    return work


async def test_a_machine_that_stands_is_accepted_after_one_window(work: Work) -> None:
    tracker = StreamingTracker(lambda t: 0.0)
    await settle(seen_by(work, tracker))
    assert work.memory.settled
    assert tracker.last_s == pytest.approx(work.limits.settle_window_s, abs=0.06)


async def test_what_is_told_is_the_scatter_in_space_of_the_samples(
    work: Work, heard: Heard
) -> None:
    tracker = StreamingTracker(lambda t: 0.0)
    await settle(seen_by(work, tracker))
    given = np.array(tracker.given)
    variances = np.sum((given - given.mean(axis=0)) ** 2, axis=0) / (len(given) - 1)
    assert heard.of(ev.LiveScatter)[0].std_mm == pytest.approx(np.sqrt(variances.sum()))


async def test_a_machine_that_creeps_slowly_and_for_ever_is_never_accepted(
    work: Work, heard: Heard
) -> None:
    """Its scatter is well below the limit all the time: it is the creep alone that shows."""
    speed = 4.0 * work.limits.settle_creep_mm / work.limits.settle_window_s
    with pytest.raises(NotReady, match="does not come to rest"):
        await settle(seen_by(work, StreamingTracker(lambda t: speed * t)))
    assert not work.memory.settled
    looks = heard.of(ev.LiveScatter)
    assert len(looks) > 100
    assert all(look.std_mm < look.limit_mm for look in looks)


async def test_a_machine_that_vibrates_about_one_place_is_never_accepted(work: Work) -> None:
    shaking = StreamingTracker(lambda t: 0.06 * float(np.sin(40.0 * t)))
    with pytest.raises(NotReady, match="does not come to rest"):
        await settle(seen_by(work, shaking))


async def test_creep_that_dies_away_is_waited_for(work: Work) -> None:
    """With x = a exp(-t/tau) the halves of a window differ by its slope times half the window."""
    a, tau = 0.2, 1.0
    window, limit = work.limits.settle_window_s, work.limits.settle_creep_mm
    tracker = StreamingTracker(lambda t: a * float(np.exp(-t / tau)))
    await settle(seen_by(work, tracker))
    creep = 0.5 * window * a / tau * np.exp(-(tracker.last_s - 0.5 * window) / tau)
    assert 0.3 * limit < creep < limit + NOISE_MM


class OneByOne:
    """Without a continuous mode; every reading takes longer than settling may last."""

    can = TrackerCan()

    def __init__(self, work: Work, x: Sequence[float]) -> None:
        self._work, self._x = work, iter(x)
        self.readings = 0

    async def measure(self, dwell_s: float) -> TrackerReading:
        clock = self._work.clock
        clock.start_at(clock.now() + self._work.limits.settle_timeout_s + 1.0)
        self.readings += 1
        variance = NOISE_MM**2
        return TrackerReading((next(self._x), 0.0, 0.0), (variance,) * 3 + (0.0,) * 3)


async def test_readings_that_take_long_are_compared_before_settling_is_given_up(work: Work) -> None:
    tracker = OneByOne(work, [5.0, 0.0, 0.0])
    work.station._devices = Devices(None, tracker)  # type: ignore[arg-type]
    await settle(work)
    assert tracker.readings == 3
    work.memory.settled = False
    tracker = OneByOne(work, [0.0, 5.0, 10.0, 15.0, 20.0])
    work.station._devices = Devices(None, tracker)  # type: ignore[arg-type]
    with pytest.raises(NotReady, match="do not agree"):
        await settle(work)
    assert tracker.readings == 4
