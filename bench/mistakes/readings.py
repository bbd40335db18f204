"""Readings that are none, rows that stand twice, shifted or sorted, and sensors that stopped."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.mistakes.clean import at_rows, from_part, in_order, on_platform, read_rows, with_channel
from calib.runs.record import Run

Chance = np.random.Generator
Make = Callable[[Run, Chance], Run]


def _placed(run: Run, rows: np.ndarray, place: np.ndarray) -> Run:
    position = run.position.copy()
    position[:, rows] = place.reshape(3, -1)
    return replace(run, position=position)


def zeros_at_the_start(run: Run, chance: Chance) -> Run:
    """The first tenth reads 0, 0, 0."""
    read = read_rows(run)
    return _placed(run, read[: read.size // 10], np.zeros(3))


def zeros_here_and_there(run: Run, chance: Chance) -> Run:
    """Two readings of 0, 0, 0."""
    return _placed(run, chance.choice(read_rows(run), 2, replace=False), np.zeros(3))


def sentinels(run: Run, chance: Chance) -> Run:
    """Three readings of -1, -1, -1."""
    return _placed(run, chance.choice(read_rows(run), 3, replace=False), np.full(3, -1.0))


def one_axis_zero(run: Run, chance: Chance) -> Run:
    """Column z is 0 in five readings in a row."""
    read = read_rows(run)
    first = int(chance.integers(5, read.size - 10))
    position = run.position.copy()
    position[2, read[first : first + 5]] = 0.0
    return replace(run, position=position)


def stale(run: Run, chance: Chance) -> Run:
    """From two thirds on every reading is the same."""
    read = read_rows(run)
    late = read[2 * read.size // 3 :]
    return _placed(run, late, run.position[:, late[0]])


def stale_for_a_while(run: Run, chance: Chance) -> Run:
    """Six readings in the middle repeat the one before."""
    read = read_rows(run)
    first = int(chance.integers(10, read.size - 20))
    return _placed(run, read[first + 1 : first + 7], run.position[:, read[first]])


def stale_pairs(run: Run, chance: Chance) -> Run:
    """Three single readings repeat the one before."""
    read = read_rows(run)
    chosen = 3 * chance.choice(np.arange(3, read.size // 3 - 1), 3, replace=False)
    position = run.position.copy()
    position[:, read[chosen]] = position[:, read[chosen - 1]]
    return replace(run, position=position)


def stale_axis(run: Run, chance: Chance) -> Run:
    """Column y stands still in the last quarter."""
    position = run.position.copy()
    late = from_part(run, 0.75)
    position[1, late] = position[1, np.flatnonzero(late)[0]]
    return replace(run, position=position)


def each_row_twice(run: Run, chance: Chance) -> Run:
    """Every row stands twice."""
    return in_order(run, np.repeat(np.arange(run.line.size), 2))


def file_twice(run: Run, chance: Chance) -> Run:
    """The rows are pasted behind themselves."""
    return in_order(run, np.tile(np.arange(run.line.size), 2))


def some_rows_twice(run: Run, chance: Chance) -> Run:
    """Ten rows in a row are pasted twice."""
    first = int(chance.integers(10, run.line.size - 20))
    rows = list(range(run.line.size))
    return in_order(run, [*rows[: first + 10], *rows[first:]])


def rows_off_by_one(run: Run, chance: Chance) -> Run:
    """Each x, y, z stands one reading too late."""
    return _shifted(run, 0)


def rows_off_late(run: Run, chance: Chance) -> Run:
    """From the middle on each x, y, z stands one reading too late: one was lost."""
    return _shifted(run, read_rows(run).size // 2)


def _shifted(run: Run, first: int) -> Run:
    read = read_rows(run)[first:]
    position = run.position.copy()
    position[:, read[1:]] = position[:, read[:-1]]
    return replace(run, position=position)


def sorted_by_text(run: Run, chance: Chance) -> Run:
    """The rows are sorted by the text of the pose label, times written anew."""
    rows = sorted(range(run.line.size), key=lambda k: (run.pose[k] != "home", run.pose[k]))
    return in_order(run, rows)


def sorted_by_number(run: Run, chance: Chance) -> Run:
    """The rows are sorted by the number of the pose, times written anew."""

    def key(k: int) -> tuple[int, str]:
        label = run.pose[k]
        return (int(label) if label.isdigit() else -1, run.nest[k])

    return in_order(run, sorted(range(run.line.size), key=key))


def sorted_with_times(run: Run, chance: Chance) -> Run:
    """The rows are sorted by the text of the label, times kept."""
    rows = sorted(range(run.line.size), key=lambda k: (run.pose[k] != "home", run.pose[k]))
    return in_order(run, rows, timed=True)


def values_lost(values: tuple[float, ...], name: str = "structure_temp_C") -> Make:
    """Single values of a channel that stand for a lost sensor."""

    def make(run: Run, chance: Chance) -> Run:
        column = run.channels[name].copy()
        column[chance.choice(column.size, len(values), replace=False)] = values
        return with_channel(run, name, column)

    return make


def sensor_dead(value: float, part: float = 0.0, name: str = "structure_temp_C") -> Make:
    """From a part of the run on a channel holds one value."""

    def make(run: Run, chance: Chance) -> Run:
        column = run.channels[name].copy()
        column[int(part * column.size) :] = value
        return with_channel(run, name, column)

    return make


def sensor_stuck(run: Run, chance: Chance) -> Run:
    """The sensor stands still from the middle on."""
    column = run.channels["structure_temp_C"].copy()
    half = column.size // 2
    column[half:] = column[half]
    return with_channel(run, "structure_temp_C", column)


def sensor_stuck_a_while(run: Run, chance: Chance) -> Run:
    """The sensor stands still for the middle third, then goes on."""
    column = run.channels["structure_temp_C"].copy()
    third = column.size // 3
    column[third : 2 * third] = column[third]
    return with_channel(run, "structure_temp_C", column)


def sensor_jumps(run: Run, chance: Chance) -> Run:
    """From the middle on the sensor reads 8 K more: it was plugged in elsewhere."""
    column = run.channels["structure_temp_C"].copy()
    column[column.size // 2 :] += 8.0
    return with_channel(run, "structure_temp_C", column)


def one_value_wrong(run: Run, chance: Chance) -> Run:
    """One temperature lost its decimal point."""
    column = run.channels["structure_temp_C"].copy()
    column[chance.integers(column.size)] *= 100.0
    return with_channel(run, "structure_temp_C", column)


def several_strays(run: Run, chance: Chance) -> Run:
    """Two readings are off by 5 mm each: a broken beam."""
    rows = chance.choice(np.flatnonzero(on_platform(run)), 2, replace=False)
    off = chance.normal(size=(3, run.line.size)) * 5.0
    return replace(run, position=run.position + np.where(at_rows(run, rows), off, 0.0))
