"""Readings that are no measurement: exactly zero, or the reading before them once more.

A tracker that is measuring never reads the same point twice to its last digit while the SMR stands
elsewhere; a file that holds a row twice holds one reading.
"""

from collections import Counter
from dataclasses import replace

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.chance import poisson_at_least
from calib.look.digits import decimals_of
from calib.look.filled import filled_down
from calib.look.sentinels import sentinels
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

BY_CHANCE = 1e-4
"""Probability that rows agree to the last digit, from which on that is no chance."""
A_STEP = 1e-3
"""Part of the travel used in a run by which the SMR stands clearly elsewhere."""
ONE_AXIS = 5
"""Successive readings that must agree along one axis alone."""


def no_measurements(run: Run) -> tuple[Run, list[Remark]]:
    """Set aside readings of exactly zero, rows that stand twice, and readings that are stale."""
    remarks = []
    for look in (_zeros, _twice, _stale, _same, _stale_axes, filled_down, sentinels):
        which, remark = look(run)
        if remark is not None:
            run = replace(run, measured=run.measured & ~which)
            remarks.append(remark)
    return run, remarks


def _zeros(run: Run) -> tuple[BoolArray, Remark | None]:
    which = run.measured & np.all(run.position == 0.0, axis=0)
    if not which.any():
        return which, None
    lines = ranges(run.line[which])
    return which, Remark(
        "zero-readings",
        f"{_count(which)} exactly 0, 0, 0: no measurement",
        lines,
        "A tracker that stands in the room reads no SMR at its own origin",
        f"Set aside ({lines_in_words(lines)})",
        "Remove these rows' x..sz, or measure these poses again",
        True,
        run.source,
    )


def _twice(run: Run) -> tuple[BoolArray, Remark | None]:
    """Rows that repeat an earlier row in every digit at the same place."""
    which = np.zeros(run.line.size, dtype=bool)
    first: dict[bytes, int] = {}
    for row in np.flatnonzero(run.measured):
        last = first.setdefault(run.position[:, row].tobytes(), int(row))
        which[row] = last != row and _one_stop(run, int(row), last)
    found = int(which.sum())
    if not found or poisson_at_least(found, _one_stop_pairs(run) * _agreement(run)) > BY_CHANCE:
        return np.zeros_like(which), None
    lines = ranges(run.line[which], run.line[run.measured])
    return which, Remark(
        "rows-twice",
        f"{_count(which)} an earlier row once more",
        lines,
        "Nest, actuators and all digits of x, y, z are those of an earlier row",
        f"Counted once ({lines_in_words(lines)} set aside)",
        "Write every reading once",
        True,
        run.source,
    )


def _stale(run: Run) -> tuple[BoolArray, Remark | None]:
    """Readings that did not change when the SMR did."""
    before, _ = _pairs(run)
    span = _span(run)
    which = np.zeros(run.line.size, dtype=bool)
    for row, last in enumerate(before):
        if last < 0 or not np.array_equal(run.position[:, row], run.position[:, last]):
            continue
        which[row] = which[last] or _elsewhere(run, row, int(last), span)
    if not which.any() or _agreement(run) > BY_CHANCE:
        return np.zeros_like(which), None
    lines = ranges(run.line[which], run.line[run.measured])
    return which, Remark(
        "stale-readings",
        f"Readings no longer change from line {lines[0][0]} on: the tracker was not measuring"
        if lines[-1][1] == run.line[run.measured][-1] and len(lines) == 1
        else f"{_count(which)} the one before to the last digit: the tracker was not measuring",
        lines,
        "The SMR was carried or the machine moved, and x, y, z are the same to the last digit",
        f"Set aside ({lines_in_words(lines)})",
        "Measure these poses again, and see why the tracker sent its last reading",
        True,
        run.source,
    )


def _same(run: Run) -> tuple[BoolArray, Remark | None]:
    """Readings that are one point to the last digit, at different places and not in a row."""
    which = np.zeros(run.line.size, dtype=bool)
    groups: dict[bytes, list[int]] = {}
    for row in np.flatnonzero(run.measured):
        groups.setdefault(run.position[:, row].tobytes(), []).append(int(row))
    span = _span(run)
    for rows in groups.values():
        if any(_elsewhere(run, row, rows[0], span) for row in rows[1:]):
            which[rows] = True
    if not which.any() or _agreement(run) > BY_CHANCE:
        return np.zeros_like(which), None
    lines = ranges(run.line[which], run.line[run.measured])
    point = ", ".join(f"{value:g}" for value in run.position[:, which][:, 0])
    return which, Remark(
        "same-readings",
        f"{_count(which)} the same point to the last digit ({point}) at different places of the "
        "SMR: no measurement",
        lines,
        "The SMR was elsewhere, and x, y, z are the same",
        f"Set aside ({lines_in_words(lines)})",
        "Leave x..sz empty where nothing was read, or measure these poses again",
        True,
        run.source,
    )


def _stale_axes(run: Run) -> tuple[BoolArray, Remark | None]:
    """One column of x, y, z that stands still while the others go on."""
    before, _ = _pairs(run)
    which = np.zeros(run.line.size, dtype=bool)
    stuck: list[str] = []
    for axis, name in enumerate("xyz"):
        still = np.zeros(run.line.size, dtype=np.intp)
        for row, last in enumerate(before):
            alike = last >= 0 and run.position[axis, row] == run.position[axis, last]
            if alike and not _one_stop(run, row, int(last)):
                still[row] = still[last] + 1
        own = np.zeros_like(which)
        for end in np.flatnonzero(still >= ONE_AXIS - 1):
            row = int(end)
            while still[row] > 0:
                own[row] = True
                row = int(before[row])
        if own.any():
            stuck.append(name)
            which |= own
    if not stuck:
        return which, None
    lines = ranges(run.line[which], run.line[run.measured])
    named = " and ".join(stuck)
    return which, Remark(
        "stale-column",
        f"Column {named} stands still in {lines_in_words(lines)} while the SMR moves",
        lines,
        f"{named} repeats to the last digit, the other axes do not",
        "Set aside",
        "Measure these poses again, and see how the readings were written",
        True,
        run.source,
    )


def _pairs(run: Run) -> tuple[IntArray, BoolArray]:
    """Index of the reading before each reading (-1: none), and whether its nest is the same."""
    before = np.full(run.line.size, -1, dtype=np.intp)
    rows = np.flatnonzero(run.measured)
    before[rows[1:]] = rows[:-1]
    same = np.array(
        [last >= 0 and run.nest[row] == run.nest[last] for row, last in enumerate(before)]
    )
    return before, same


def _one_stop(run: Run, row: int, last: int) -> bool:
    """Whether two readings are of one nest at one stop of the machine."""
    return run.nest[row] == run.nest[last] and np.array_equal(run.q[:, row], run.q[:, last])


def _span(run: Run) -> Array:
    """How far each actuator (n,) goes in a run."""
    return np.asarray(np.ptp(run.q[:, run.measured], axis=1))


def _elsewhere(run: Run, row: int, last: int, span: Array) -> bool:
    """Whether the SMR stood clearly elsewhere at two readings: steps of some um may not show.

    ``span`` (n,) is how far each actuator goes in the run.
    """
    if run.nest[row] != run.nest[last]:
        return True
    return bool(np.any(np.abs(run.q[:, row] - run.q[:, last]) > A_STEP * span))


def _one_stop_pairs(run: Run) -> int:
    """How many pairs of readings are of one nest at one stop."""
    stops = Counter(
        (run.nest[row], run.q[:, row].tobytes()) for row in np.flatnonzero(run.measured)
    )
    return sum(count * (count - 1) // 2 for count in stops.values())


def _agreement(run: Run) -> float:
    """Probability that two readings of one point agree to the last digit."""
    position = run.position[:, run.measured]
    variances = np.einsum("iin->in", run.covariance[:, :, run.measured])
    sigma = np.sqrt(np.median(variances, axis=1))
    step = 10.0 ** -decimals_of(position)
    return float(np.prod(np.minimum(1.0, step / (2.0 * np.sqrt(np.pi) * sigma))))


def _count(which: BoolArray) -> str:
    count = int(which.sum())
    return "One reading is" if count == 1 else f"{count} readings are"
