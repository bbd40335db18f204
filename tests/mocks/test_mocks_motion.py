"""Legs as functions of time; play; wander."""

import numpy as np
import pytest

from mocks.clock import ManualClock, ScaledClock
from mocks.physics.motion import STOPPING_S, LegMotion
from mocks.physics.play import advance, follow
from mocks.physics.signals import Steps, Wander, mean_variance


def test_leg_goes_there_smoothly_and_rests() -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    leg.command(10.0, 2.0)
    path = []
    for _ in range(201):
        path.append(leg.position())
        clock.advance(0.01)
    assert path[0] == 0.0
    assert path[-1] == 10.0
    assert not leg.moving
    speed = np.diff(path) / 0.01
    assert np.all(speed >= 0.0)
    assert np.max(np.abs(np.diff(speed))) < 0.2


@pytest.mark.parametrize("at", [0.1, 0.7, 1.0, 1.9])
def test_new_command_on_the_way_has_no_jump(at: float) -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    leg.command(10.0, 2.0)
    clock.advance(at - 1e-6)
    before = leg.position()
    clock.advance(1e-6)
    leg.command(-5.0, 1.0)
    clock.advance(1e-6)
    assert leg.position() == pytest.approx(before, abs=1e-4)
    clock.advance(1.0)
    assert leg.position() == pytest.approx(-5.0)


def test_stop_brakes_within_its_time() -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    leg.command(10.0, 2.0)
    clock.advance(1.0)
    leg.stop()
    assert leg.moving
    clock.advance(STOPPING_S)
    where = leg.position()
    assert not leg.moving
    assert 5.0 < where < 6.0
    assert leg.target == pytest.approx(where)
    clock.advance(10.0)
    assert leg.position() == where


def test_stop_at_rest_changes_nothing() -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    leg.command(3.0, 0.5)
    clock.advance(1.0)
    leg.stop()
    assert (leg.position(), leg.target, leg.moving) == (3.0, 3.0, False)


def test_stalled_leg_stays_whatever_is_commanded() -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    leg.command(10.0, 2.0)
    clock.advance(1.0)
    leg.stalled = True
    where = leg.position()
    clock.advance(5.0)
    leg.command(-10.0, 1.0)
    clock.advance(5.0)
    assert (leg.position(), leg.target, leg.moving) == (where, -10.0, False)
    leg.stalled = False
    leg.command(1.0, 1.0)
    clock.advance(2.0)
    assert leg.position() == 1.0


def test_history_agrees_with_what_was_read_at_the_time() -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    rng = np.random.default_rng(1)
    times, read = [], []
    for _ in range(300):
        if rng.random() < 0.1:
            leg.command(float(rng.uniform(-20, 20)), float(rng.uniform(0.2, 3.0)))
        clock.advance(0.1)
        times.append(clock.now())
        read.append(leg.position())
    assert leg.history(np.array(times)).extension == pytest.approx(read, abs=1e-12)


def test_leg_remembers_its_moves_as_long_as_it_is_asked_to() -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    leg.command(6.0, 2.0)
    clock.advance(2.0)
    leg.command(-4.0, 3.0)  # from 6 to -4, over at 5 s
    clock.advance(100.0)
    left = leg.remembered(np.array([-1.0, 1.0, 2.0, 5.0, 65.0]), 60.0)
    after = 6.0 * np.exp(-3.0 / 60.0) - 10.0
    assert left == pytest.approx([0.0, 3.0, 6.0, after, after / np.e])
    assert leg.remembered(np.array([50.0]), 1e9) == pytest.approx([-4.0])


def test_leg_remembers_of_a_move_that_was_broken_off_what_was_made() -> None:
    clock = ManualClock()
    leg = LegMotion(clock)
    leg.command(10.0, 2.0)
    clock.advance(1.0)
    leg.command(5.0, 1.0)
    clock.advance(10.0)
    assert leg.remembered(np.array([10.0]), 1e9) == pytest.approx([5.0])


def test_lost_motion_after_moves_up_and_down() -> None:
    """Catalogue: extension = -b/2 after a move forward, +b/2 after a move back."""
    width = np.array([0.02])
    forward = advance(np.zeros(1), np.array([5.0]), width)
    assert forward == pytest.approx([-0.01])
    assert advance(forward, np.array([-3.0]), width) == pytest.approx([0.01])
    half_way = advance(forward, np.array([-0.005]), width)
    assert half_way == pytest.approx([-0.005])


def test_play_of_legs_and_of_tables_agree() -> None:
    rng = np.random.default_rng(2)
    clock = ManualClock()
    widths = np.array([0.015, 2.0])
    leg = LegMotion(clock, widths)
    stations = np.concatenate([[0.0], rng.uniform(-10, 10, 30)])
    seen = [np.zeros(2)]
    for target in stations[1:]:
        leg.command(float(target), 1.0)
        clock.advance(1.5)
        seen.append(leg.history(np.array([clock.now()])).play[0])
    table = follow(stations[:, None], widths[None, :])[:, 0]
    assert np.array(seen) == pytest.approx(table, abs=1e-12)


def test_wander_has_its_variance_and_correlation_time() -> None:
    tau, step, rng = 1.0, 0.25, np.random.default_rng(3)
    signals = np.vstack([Wander(rng, tau, 3).at(np.arange(0.0, 400.0, step)) for _ in range(40)])
    assert np.mean(signals**2) == pytest.approx(1.0, abs=0.05)
    for lag in (1, 4, 8):
        correlation = np.mean(signals[:, lag:] * signals[:, :-lag])
        assert correlation == pytest.approx(np.exp(-lag * step / tau), abs=0.06)


def test_mean_of_wander_is_the_integral_and_has_its_variance() -> None:
    rng = np.random.default_rng(4)
    wander = Wander(rng, 1.0, 3)
    fine = wander.at(np.linspace(10.0, 13.0, 30001)).mean(axis=1)
    assert wander.mean(10.0, 13.0) == pytest.approx(fine, abs=1e-3)
    means = np.array([Wander(rng, 1.0, 3).mean(t, t + 3.0) for t in rng.uniform(0, 1e4, 3000)])
    assert np.var(means) == pytest.approx(mean_variance(3.0, 1.0), rel=0.06)


def test_steps_hold_between_changes() -> None:
    steps = Steps(np.zeros(()))
    steps.set(1.0, np.asarray(5.0))
    steps.set(2.0, np.asarray(7.0))
    assert steps.at(np.array([0.5, 1.0, 1.9, 2.0, 9.0])).tolist() == [0.0, 5.0, 5.0, 7.0, 7.0]


def test_scaled_clock_runs_at_its_scale() -> None:
    clock = ScaledClock(1000.0)
    first = clock.now()
    while clock.now() < first + 20.0:
        pass
    assert clock.wall(20.0) == 0.02
    with pytest.raises(ValueError, match="must be positive"):
        ScaledClock(0.0)
