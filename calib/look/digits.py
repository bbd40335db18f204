"""Coordinates that were rounded more coarsely than their stated uncertainty."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.runs.record import Run
from calib.runs.remark import Remark

DECIMALS = 9
"""Digits behind the point, mm, that are looked for."""
COARSE = 2.0
"""Standard deviation of rounding over the stated one from which on it is said."""
LEAST = 10
"""Fewest readings that tell."""


def decimals_of(values: Array) -> int:
    """Digits behind the point with which numbers were written."""
    for digits in range(DECIMALS):
        if np.allclose(values, np.round(values, digits), rtol=0.0, atol=1e-11):
            return digits
    return DECIMALS


def rounding(run: Run) -> tuple[Run, list[Remark]]:
    """Give rounded readings the uncertainty that rounding leaves: a step over sqrt(12)."""
    position = run.position[:, run.measured]
    if position.shape[1] < LEAST:
        return run, []
    step = 10.0 ** -decimals_of(position)
    left = step / np.sqrt(12.0)
    variances = np.einsum("iin->in", run.covariance[:, :, run.measured])
    stated = float(np.sqrt(np.median(variances)))
    if left < COARSE * stated:
        return run, []
    covariance = run.covariance + left**2 * np.eye(3)[:, :, None]
    return replace(run, covariance=covariance), [
        Remark(
            "points-rounded",
            f"x, y, z are rounded to {step:g} mm, while sx, sy, sz say {stated:.3g} mm",
            (),
            f"No reading has more digits; rounding alone leaves {left:.2g} mm an axis",
            f"Read with that uncertainty added ({left:.2g} mm)",
            "Export the readings with all their digits, and measure nothing again",
            True,
            run.source,
        )
    ]
