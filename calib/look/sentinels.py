"""Numbers that stand for no reading in x, y, z: 999, -127, 1e9, in all three or in one of them."""

import numpy as np

from calib.arrays import BoolArray
from calib.look.digits import decimals_of
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

NUMBERS = (
    0.0, 85.0, 127.0, 99.0, 99.99, 999.0, 999.9, 999.99, 999.999, 9999.0, 9999.9, 9999.99, 9999.999,
    99999.0, 999999.0, 32767.0, 65535.0,
)  # fmt: skip
"""What programs write instead of a coordinate, of either sign, exactly."""
FARTHEST_MM = 1e8
"""Coordinate, mm, that no tracker reads."""
DIGITS = 3
"""Digits behind the point with which such a number is no chance along one axis."""


def sentinels(run: Run) -> tuple[BoolArray, Remark | None]:
    """Readings with a number in them, or three alike, that says that there is none.

    Along one axis only where readings have so many digits that none is round by chance, and where a
    coordinate does not stand at that number throughout.
    """
    read = run.position[:, run.measured]
    written = np.zeros(run.position.shape, dtype=bool)
    if read.shape[1] == 0:
        return written[0], None
    alike = np.all(run.position == run.position[0], axis=0) & (run.position[0] != 0.0)
    for axis in range(3):
        values = run.position[axis]
        marked = np.isin(np.abs(values), NUMBERS) & run.measured
        if decimals_of(values[run.measured & ~marked]) < DIGITS or 2 * marked.sum() > len(marked):
            marked[:] = False
        written[axis] = marked | (np.abs(values) > FARTHEST_MM)
    which = run.measured & (alike | written.any(axis=0)) & ~np.all(run.position == 0.0, axis=0)
    if not which.any():
        return which, None
    lines = ranges(run.line[which], run.line[run.measured])
    number = run.position[0] if (alike & which).any() else np.where(written, run.position, np.nan)
    told = np.unique(number[..., which][np.isfinite(number[..., which])])
    one = int(which.sum()) == 1
    return which, Remark(
        "sentinel-readings",
        f"{'One reading holds' if one else f'{int(which.sum())} readings hold'} "
        f"{', '.join(f'{value:g}' for value in told[:3])} in place of coordinates: no measurement",
        lines,
        "No reading is that number to the last digit; programs write it where they have none",
        f"Set aside ({lines_in_words(lines)})",
        "Leave x..sz empty where nothing was read, or measure these poses again",
        True,
        run.source,
    )
