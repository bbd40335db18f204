"""Creep: what is left of all moves, against sums written out."""

from dataclasses import replace

import numpy as np
import pytest
from effects_rows import predicted, readings_of

from calib.effects import effect_named
from calib.effects.creep import left_of_changes
from calib.runs.commanded import CommandedPath, joined_paths

TAU = 200.0


def path_of(seed: int, rows: int = 37) -> CommandedPath:
    generator = np.random.default_rng(seed)
    extension = generator.uniform(-20.0, 20.0, (3, rows))
    extension[:, 5:9] = extension[:, 5:6]  # several readings at one stop
    time = np.cumsum(generator.uniform(1.0, 60.0, rows))
    return CommandedPath.of_run(extension, time, np.full(3, 1e-4))


def written_out(path: CommandedPath, row: int, tau: float) -> np.ndarray:
    """Go back from a row, change by change."""
    total, at = np.zeros(len(path.extension)), row
    while at >= 0:
        total += path.change[:, at] * np.exp((path.time_s[at] - path.time_s[row]) / tau)
        at = int(path.before[at])
    return total


def test_every_change_since_the_run_began_is_left_in_part() -> None:
    path = joined_paths([path_of(1), path_of(2, 20)])
    path = path.branched(9, np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), path.time_s[9] + 30.0)
    left, _ = left_of_changes(path, TAU)
    expected = np.stack([written_out(path, row, TAU) for row in range(path.count)], axis=1)
    np.testing.assert_allclose(left, expected, atol=1e-12)


def test_sum_by_age_is_the_derivative_by_the_rate() -> None:
    path, rate, small = path_of(3), 1.0 / TAU, 1e-8
    ahead, back = (left_of_changes(path, 1.0 / (rate + s * small))[0] for s in (1.0, -1.0))
    _, by_age = left_of_changes(path, TAU)
    np.testing.assert_allclose(by_age, (back - ahead) / (2.0 * small), rtol=1e-5, atol=1e-3)


def test_who_waits_long_enough_has_lost_nothing() -> None:
    path = path_of(4)
    left, _ = left_of_changes(replace(path, time_s=1e6 * path.time_s), TAU)
    np.testing.assert_allclose(left, path.change, atol=1e-12)
    left, _ = left_of_changes(path, 1e12)
    np.testing.assert_allclose(left, path.extension - path.extension[:, :1], atol=1e-6)


@pytest.mark.parametrize("name", ["hexapod", "ptm"])
def test_readings_at_one_stop_differ_by_their_age(name: str) -> None:
    """The actuators are short of the way at first: k of it, and less as time passes."""
    rows = readings_of(name)
    effect = effect_named("creep", rows.machine)
    moved = predicted(rows, effect, np.array([2e-3, TAU])) - predicted(
        rows, effect, np.array([0.0, TAU])
    )
    one = [k for k in range(rows.count) if rows.pose_name[k] == rows.pose_name[rows.count // 2]]
    assert len({rows.time_s[k] for k in one}) > 1
    assert len(np.unique(np.round(moved[:, one], 9), axis=1).T) > 1


def test_a_run_in_which_nothing_moves_or_no_time_passes_cannot_show_it() -> None:
    rows = readings_of("hexapod")
    effect = effect_named("creep", rows.machine)
    assert effect.unavailable(rows) == ""
    still = replace(rows.path, extension=np.zeros_like(rows.path.extension))
    assert effect.unavailable(replace(rows, path=still)) == "no row follows a move"
    at_once = replace(rows.path, time_s=np.zeros(rows.path.count))
    assert "no time passes" in effect.unavailable(replace(rows, path=at_once))
