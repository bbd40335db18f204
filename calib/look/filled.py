"""Cells that a spreadsheet made: readings dragged down in equal steps."""

import numpy as np

from calib.arrays import BoolArray
from calib.look.digits import decimals_of
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

DIGITS = 2.5
"""How near two steps must be to be one step, in units of the last digit."""
MOVED_MM = 0.1
"""Least step, mm: readings of one place may be alike."""
STEPS = 3
"""Successive equal steps of all of x, y, z that no measurement makes."""


def filled_down(run: Run) -> tuple[BoolArray, Remark | None]:
    """Readings that go on by one and the same step along all axes."""
    which = np.zeros(run.line.size, dtype=bool)
    read = np.flatnonzero(run.measured)
    if read.size < STEPS + 2:
        return which, None
    step = np.diff(run.position[:, read], axis=1)
    digit = 10.0 ** -decimals_of(run.position[:, read])
    moved = np.abs(step[:, 1:]).max(axis=0) > max(MOVED_MM, 100.0 * digit)
    alike = moved & np.all(np.abs(np.diff(step, axis=1)) < DIGITS * digit, axis=0)
    first = 0
    while first < alike.size:
        last = first
        while last < alike.size and alike[last]:
            last += 1
        if last - first >= STEPS - 1:  # the two readings at the head were measured
            which[read[first + 2 : last + 2]] = True
        first = last + 1
    if not which.any():
        return which, None
    lines = ranges(run.line[which], run.line[read])
    return which, Remark(
        "filled-down",
        f"{int(which.sum())} readings were filled down, not measured: x, y, z go on by equal "
        f"steps in {lines_in_words(lines)}",
        lines,
        "The steps from row to row are equal to the last digit along all three axes",
        "Set aside",
        "Put back what was measured there, or measure these poses again",
        True,
        run.source,
    )
