"""x, y, z of some rows in another unit than those of the others."""

from dataclasses import replace

import numpy as np

from calib.arrays import BoolArray
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

APART = 8.0
"""Ratio of distances from the tracker that parts two units."""
FARTHEST_MM = 1e5
"""Distance of an SMR from the tracker beyond which coordinates look like um."""
_UNITS = ((1000.0, "m"), (25.4, "inches"), (0.001, "um"))


def point_units(run: Run) -> tuple[Run, list[Remark]]:
    """Read rows in mm whose points are as far as all others once they are read in another unit."""
    distance = np.linalg.norm(run.position, axis=0)
    known = np.sort(distance[run.measured & (distance > 0.0)])
    if known.size < 2:
        return run, []
    gap = int(np.argmax(known[1:] / known[:-1]))
    low, high = known[: gap + 1], known[gap + 1 :]
    if high[0] < APART * low[-1]:
        return run, []
    in_um = float(np.median(high)) > FARTHEST_MM
    good, odd = (low, high) if in_um else (high, low)
    for factor, unit in _UNITS:
        if np.all((factor * odd > 0.8 * good[0]) & (factor * odd < 1.25 * good[-1])):
            far = run.measured & (distance >= odd[0]) & (distance <= odd[-1])
            return _read_as(run, far, factor, unit, (float(np.median(odd)), float(np.median(good))))
    return run, []


def _read_as(
    run: Run, far: BoolArray, factor: float, unit: str, sizes: tuple[float, float]
) -> tuple[Run, list[Remark]]:
    lines = ranges(run.line[far], run.line[run.measured])
    return replace(run, position=np.where(far, factor, 1.0) * run.position), [
        Remark(
            "points-unit",
            f"x, y, z in {lines_in_words(lines)} look like {unit}",
            lines,
            f"The SMR is {sizes[0]:.4g} from the tracker there, {sizes[1]:.4g} elsewhere",
            f"Read as {unit}",
            "Write x, y, z in mm",
            True,
            run.source,
        )
    ]
