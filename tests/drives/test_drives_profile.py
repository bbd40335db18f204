"""Laws of the common profile."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.drives.axis import Axis
from drivers.drives.plan import Referenced
from drivers.drives.profile import Profile
from drivers.drives.way import Straight

WAY = st.floats(-40.0, 40.0).map(lambda way: round(way, 9))  # a drive counts no finer
WAYS = st.lists(WAY, min_size=2, max_size=6)
FASTEST = st.tuples(st.floats(0.5, 50.0), st.floats(1.0, 500.0))


def axes(count: int, fastest: tuple[float, float]) -> list[Axis]:
    speed, acceleration = fastest
    return [
        Axis(
            f"q{n}", "mm", n + 1, Path(), 1e5 * (n + 1), 1.0, 0.0, None, (-50.0, 50.0),
            speed * (n + 1), acceleration,
        )
        for n in range(count)
    ]  # fmt: skip


@given(WAYS, FASTEST)
def test_no_axis_is_faster_than_it_may_and_one_is_as_fast(ways, fastest):
    each = axes(len(ways), fastest)
    profile = Profile.of(each, ways)
    if not any(ways):
        assert profile.duration == 0.0
        return
    speeds = [abs(way) * profile.rate / axis.speed for axis, way in zip(each, ways, strict=True)]
    accelerations = [
        abs(way) * profile.acceleration / axis.acceleration
        for axis, way in zip(each, ways, strict=True)
    ]
    assert max(speeds) == pytest.approx(1.0)
    assert max(accelerations) == pytest.approx(1.0)


@settings(max_examples=50)
@given(st.floats(2.0, 40.0), st.floats(2.0, 40.0), FASTEST)
def test_drives_with_ramps_of_their_own_need_the_same_time(first, second, fastest):
    """What a drive makes of 0x6081 and 0x6083 in counts lasts as long on every axis."""
    each = axes(2, fastest)
    profile = Profile.of(each, [first, second])

    def lasts(axis: Axis, way: float) -> float:
        speed = profile.speed_of(axis, way) / axis.counts
        ramp = profile.acceleration_of(axis, way) / axis.counts
        return way / speed + speed / ramp if speed**2 < way * ramp else 2.0 * (way / ramp) ** 0.5

    assert lasts(each[0], first) == pytest.approx(lasts(each[1], second), rel=1e-2)
    assert lasts(each[0], first) == pytest.approx(profile.duration, rel=1e-2)


@settings(max_examples=30)
@given(st.floats(0.1, 50.0), st.floats(0.1, 500.0))
def test_the_ramp_is_smooth_and_within_its_speed(rate, acceleration):
    profile = Profile(rate, acceleration)
    steps = 100
    step = profile.duration / steps
    at = [profile.at(k * step) for k in range(-1, steps + 2)]
    speeds = [(b - a) / step for a, b in pairwise(at)]
    assert at[0] == 0.0
    assert at[-1] == 1.0
    assert min(speeds) >= 0.0
    assert max(speeds) <= rate * (1.0 + 1e-9)
    bends = [abs(b - a) / step for a, b in pairwise(speeds)]
    assert max(bends) <= acceleration * (1.0 + 1e-6)
    assert profile.at(0.5 * profile.duration) == pytest.approx(0.5)


@given(st.floats(-50.0, 50.0), st.sampled_from([1.0, -1.0]), st.floats(-300.0, 300.0))
def test_counts_and_back(q, sign, offset):
    axis = Axis("q1", "mm", 1, Path(), 209_715.2, sign, offset, None, (-50.0, 50.0), 1.0, 1.0)
    assert axis.to_q(axis.to_counts(q)) == pytest.approx(q, abs=0.5 / 209_715.2 + 1e-9)
    low, high = axis.limits_in_counts()
    assert low < high


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("homing", Referenced()),
        ("always", Referenced(always=True)),
        ("0x6041 bit 15", Referenced(index=0x6041, bit=15)),
        ("0x2010:3 bit 0", Referenced(index=0x2010, sub=3)),
        ("bit 15", None),
        ("0x6041", None),
    ],
)
def test_where_a_drive_says_its_reference(text, meant):
    assert Referenced.parse(text) == meant


@settings(max_examples=40)
@given(
    st.lists(st.integers(-5_000_000, 5_000_000), min_size=3, max_size=3),
    st.floats(0.05, 0.95),
    FASTEST,
)
def test_what_is_braked_stays_on_its_way_and_brakes_as_hard_as_it_may(ends, when, fastest):
    each = axes(3, fastest)
    way = Straight.of(each, (0, 0, 0), tuple(ends))
    begun = when * way.duration
    braked = way.braked(begun)
    again = braked.braked(0.3 * braked.duration)
    period = 0.01
    times = np.arange(0.0, braked.duration + 2.0 * period, period)
    points = np.array([way.at(begun - period), *(braked.at(t) for t in times)])
    assert np.abs(np.array(again.at(again.duration)) - braked.ends).max() <= 1
    hardest = np.array([a.acceleration * abs(a.scale) for a in each]) * period**2
    assert (np.abs(np.diff(points, n=2, axis=0)) <= hardest + 4.0).all()
    low, high = np.minimum(ends, 0), np.maximum(ends, 0)
    assert ((points >= low) & (points <= high)).all()
    assert (points[-1] == points[-2]).all()
