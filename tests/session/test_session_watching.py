"""What is wrong with readings is heard at that pose: stale, zero, too far apart, a dead sensor."""

import asyncio
import itertools
import time
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from session_mock import POSES, Heard, site_text

from app.files.site import parse_site
from app.session import events as ev
from app.session.plans import PlanOptions, measure_plan
from app.session.routines.beam import measured, settle
from app.session.routines.watching import watch
from app.session.rows import NewRow
from app.session.session import Session
from app.session.station import Devices
from app.session.work import Work
from calib.frames import nest_in_base
from drivers.errors import NotReady
from drivers.interface import TrackerCan, TrackerReading, TrackerState, TrackSample

COVARIANCE = (1e-5, 1e-5, 1e-5, 0.0, 0.0, 0.0)


class ScriptedTracker:
    """Reads what it is told to read, one after the other, the last for ever."""

    can = TrackerCan()

    def __init__(self, *readings: tuple[float, float, float]) -> None:
        self.readings = list(readings)
        self.asked = 0

    async def state(self) -> TrackerState:
        return TrackerState(True, True, True, True, "", 0)

    async def measure(self, dwell_s: float) -> TrackerReading:
        self.asked += 1
        xyz = self.readings.pop(0) if len(self.readings) > 1 else self.readings[0]
        return TrackerReading(xyz, COVARIANCE, 20.0, 1013.0, 50.0)


@pytest.fixture
def work(tmp_path: Path, heard: Heard) -> Work:
    site = parse_site(site_text(smrs=3), "site.toml", tmp_path)
    session = Session.create(site, measure_plan(site, POSES, PlanOptions()), tmp_path)
    session.observers.watch(heard)
    session.work.memory.settled = True
    return session.work


def with_tracker(work: Work, tracker: object) -> Work:
    work.station._devices = Devices(None, tracker)  # type: ignore[arg-type]
    return work


def alarms(heard: Heard) -> list[str]:
    return [f"{e.alarm.device}: {e.alarm.what}" for e in heard.of(ev.AlarmRaised)]


async def test_the_last_reading_once_more_is_none_where_the_smr_is_elsewhere(
    work: Work, heard: Heard
) -> None:
    one, two = (100.0, 200.0, 300.0), (100.1, 200.2, 300.3)
    tracker = ScriptedTracker(one, one, two)
    with_tracker(work, tracker)
    work.memory.standing_at = "a"
    await measured(work, "3", 1.0)
    work.memory.standing_at = "b"
    reading, _ = await measured(work, "3", 1.0)
    assert reading.xyz == two
    assert tracker.asked == 3
    assert "to the last digit" in heard.of(ev.Suspended)[0].why
    assert any("to the last digit" in text for _, _, text in work.journal.notes())
    # The same SMR at the same place may well be read alike by a tracker of few digits.
    again, _ = await measured(work, "3", 1.0)
    assert again.xyz == two


@pytest.mark.long
async def test_a_tracker_that_tells_zero_for_ever_ends_in_a_fault(work: Work) -> None:
    with_tracker(work, ScriptedTracker((0.0, 0.0, 0.0)))
    with pytest.raises(NotReady, match="exactly 0, 0, 0"):
        await measured(work, "3", 1.0)


def row_at(work: Work, pose: str, nest: str, off_mm: float = 0.0, **channels: float) -> NewRow:
    x, y, z = nest_in_base(POSES[pose], work.site.platform_nests[nest])
    return NewRow("reading", 1.0, pose, (0.0,) * 6, nest, (x + off_mm, y, z), COVARIANCE,
                  channels=channels)  # fmt: skip


async def test_nests_of_one_pose_that_are_too_far_apart_are_told_once(
    work: Work, heard: Heard
) -> None:
    for arrived, pose in enumerate("abc"):
        work.memory.arrived_s = float(arrived)
        watch(work, row_at(work, pose, "3"))
        watch(work, row_at(work, pose, "4"))
    assert alarms(heard) == []
    for arrived, pose in enumerate("abc", start=3):
        work.memory.arrived_s = float(arrived)
        watch(work, row_at(work, pose, "3"))
        watch(work, row_at(work, pose, "4", off_mm=0.8))
    assert len(alarms(heard)) == 1
    assert "farther apart" in alarms(heard)[0]
    assert "pose a" in alarms(heard)[0]


def tell(work: Work, values: list[float]) -> None:
    for k, value in enumerate(values):
        work.memory.channels = (float(k), {})
        watch(work, row_at(work, "a", "3", structure_temp_C=value))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ([20.1, -127.0, 20.2], "-127"),
        ([293.4], "another unit"),
        ([20.0 + 0.01 * k for k in range(20)] + [20.19] * 9, "no longer changes"),
    ],
)
async def test_a_sensor_that_is_dead_or_counts_in_kelvin_is_told(
    work: Work, heard: Heard, values: list[float], says: str
) -> None:
    tell(work, values)
    assert len(alarms(heard)) == 1
    assert says in alarms(heard)[0]


async def test_sensors_of_few_digits_in_a_steady_room_raise_no_alarm(
    work: Work, heard: Heard
) -> None:
    for seed in range(20):
        noise = np.random.default_rng(seed)
        room = 20.0 + np.cumsum(0.01 * noise.standard_normal(150))
        work.memory.seen = replace(work.memory.seen, answers={})
        tell(work, [round(float(t), 1) for t in room])
    assert alarms(heard) == []


class DazedTracker:
    """Samples that are no measurement and whose clock stands."""

    can = TrackerCan(streams=True)

    async def stream(self, separation_s: float) -> AsyncIterator[TrackSample]:
        for _ in itertools.count():
            await asyncio.sleep(0.001)
            yield TrackSample(5.0, (0.0, 0.0, 0.0), False)


async def test_samples_that_stay_invalid_while_settling_end_at_a_deadline(
    work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.session.routines.beam._SPARE_S", 0.1)
    work.memory.settled = False
    work.station.clock.scale = 400.0
    begun = time.monotonic()
    with pytest.raises(NotReady, match="samples were none"):
        await settle(with_tracker(work, DazedTracker()))
    assert time.monotonic() - begun < 60.0
