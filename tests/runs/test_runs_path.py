"""Laws of the commanded path: a reading keeps the past that it had, whatever is cut or joined."""

from pathlib import Path

import numpy as np
import pytest

from app.files.runs import read_run
from calib.runs.commanded import CommandedPath, joined_paths
from calib.runs.stack import Rows, stack

RUNS = Path(__file__).parents[1] / "data" / "runs"
MOTION = np.array([1e-4])


def walk(*extension: float) -> CommandedPath:
    return CommandedPath.of_run(np.array([extension]), np.arange(float(len(extension))), MOTION)


@pytest.fixture(scope="module")
def rows() -> Rows:
    loaded = read_run(RUNS / "backlash-leg-3")
    return stack(loaded.machine, [loaded.run])


def past(rows: Rows, row: int) -> list[tuple[float, ...]]:
    """Extensions from the start of the run to a reading, newest first."""
    found, at = [], int(rows.at[row])
    while at >= 0:
        found.append((float(rows.path.time_s[at]), *rows.path.extension[:, at]))
        at = int(rows.path.before[at])
    return found


def test_the_last_direction_is_kept_through_rest_and_rounding():
    path = walk(0.0, 0.0, 2.0, 2.0, 2.00005, 1.0, 1.0)
    assert path.direction[0].tolist() == [0, 0, 1, 1, 1, -1, -1]
    np.testing.assert_allclose(path.step[0, [1, 2, 4, 6]], [0, 2, 2, -1.00005])


def test_every_row_of_the_run_is_on_the_path(rows):
    run = rows.runs[0]
    assert rows.path.count == len(run.nest) > rows.count
    extension = rows.machine.extension(run.q, run.header.controller_parameters)
    np.testing.assert_array_equal(rows.path.extension, extension)
    np.testing.assert_array_equal(rows.path.extension[:, rows.at], rows.extension)
    np.testing.assert_array_equal(rows.path.time_s[rows.at], rows.time_s)


def test_direction_and_step_are_those_of_a_walk_through_the_rows(rows):
    run = rows.runs[0]
    last = np.zeros(6)
    wanted = {}
    for row in range(1, len(run.nest)):
        change = run.q[:, row] - run.q[:, row - 1]
        last = np.where(np.abs(change) > 1e-4, change, last)
        wanted[row] = last
    for reading, row in enumerate(rows.at):
        np.testing.assert_allclose(rows.step[:, reading], wanted.get(int(row), 0.0), atol=1e-12)
        np.testing.assert_array_equal(
            rows.direction[:, reading], np.sign(wanted.get(int(row), np.zeros(6)))
        )


@pytest.mark.parametrize("how", ["mask", "indices", "slice", "backwards"])
def test_a_cut_leaves_every_reading_its_past(rows, how):
    rng = np.random.default_rng(4)
    which = {
        "mask": rng.random(rows.count) < 0.3,
        "indices": rng.permutation(rows.count)[:40],
        "slice": slice(17, 90, 3),
        "backwards": slice(None, None, -1),
    }[how]
    chosen = np.arange(rows.count)[which]
    part = rows.take(which)
    assert part.count == chosen.size
    np.testing.assert_array_equal(part.step, rows.step[:, chosen])
    for own, row in enumerate(chosen[:10]):
        assert past(part, own) == past(rows, int(row))
        assert part.nest_name[own] == rows.nest_name[row]
        np.testing.assert_array_equal(part.position[:, own], rows.position[:, row])
    for name, values in rows.channels.items():
        np.testing.assert_array_equal(part.channels[name], values[chosen])


def test_runs_that_are_stacked_have_no_past_in_one_another(rows):
    loaded = [read_run(RUNS / name) for name in ("backlash-leg-3", "no-effect", "mystery")]
    both = stack(loaded[0].machine, [one.run for one in loaded])
    starts = np.flatnonzero(both.path.before < 0)
    assert starts.size == 3
    for number, one in enumerate(loaded):
        own = stack(one.machine, [one.run])
        here = np.flatnonzero(both.run == number)
        np.testing.assert_array_equal(both.direction[:, here], own.direction)
        for row in (0, own.count // 2, own.count - 1):
            assert past(both, int(here[row])) == past(own, row)


def test_branches_share_their_past_and_not_each_other():
    path = walk(0.0, 1.0, 0.5).branched(2, np.array([[2.0, -1.0, 0.5]]), 3.0)
    assert path.direction[0, 3:].tolist() == [1, -1, -1]
    np.testing.assert_allclose(path.step[0, 3:], [1.5, -1.5, -0.5])
    sums = path.carry(path.extension, lambda state, row: state + path.extension[:, row])
    np.testing.assert_allclose(sums[0], [0.0, 1.0, 1.5, 3.5, 0.5, 2.0])


def test_rows_between_which_nothing_moved_share_a_stop():
    path = joined_paths([walk(0.0, 0.0, 1.0, 1.0, 0.0), walk(0.0, 0.0)])
    assert path.stop.tolist() == [0, 0, 2, 2, 4, 5, 5]


def test_last_changes_are_those_that_are_carried_row_by_row() -> None:
    rng = np.random.default_rng(4)
    paths = [
        CommandedPath.of_run(
            np.cumsum(rng.integers(-1, 2, (3, count)) * rng.integers(0, 2, (3, count)), axis=1)
            * 0.5,
            np.arange(float(count)),
            np.full(3, 1e-6),
        )
        for count in (1, 9, 30)
    ]
    branched = paths[1].branched(3, paths[2].extension[:, :4], 20.0)
    for path in (*paths, joined_paths(paths), branched):
        change = path.change

        def move(last: np.ndarray, row: int, change: np.ndarray = change) -> np.ndarray:
            return np.where(change[:, row] != 0.0, change[:, row], last)

        assert np.array_equal(path.step, path.carry(np.zeros_like(change), move))
