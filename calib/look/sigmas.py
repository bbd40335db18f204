"""Stated uncertainties: single ones a thousand times those of the others."""

import numpy as np

from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

FAR = 300.0
"""Ratio to the median of the same column from which on a sigma is another unit."""
FEW = 0.2
"""Part of the rows up to which they are single ones."""


def sigmas(run: Run) -> tuple[Run, list[Remark]]:
    """Name rows whose uncertainties are far from all others; they are taken as they stand."""
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("iin->in", run.covariance))
    ratio = sigma / np.median(sigma[:, run.measured], axis=1)[:, None]
    odd = run.measured & np.any((ratio > FAR) | (ratio < 1.0 / FAR), axis=0)
    if not odd.any() or odd.sum() > FEW * run.measured.sum():
        return run, []
    lines = ranges(run.line[odd], run.line[run.measured])
    usual, here = np.median(sigma[:, run.measured]), np.median(sigma[:, odd])
    return run, [
        Remark(
            "sigma-unit-in-rows",
            f"sx, sy or sz in {lines_in_words(lines)} are {here / usual:.3g} times those of all "
            "other readings",
            lines,
            f"{here:.4g} mm where the others have {usual:.4g} mm",
            "Taken as they stand: such readings weigh nothing, or everything",
            "Write sx, sy, sz in mm",
            False,
            run.source,
        )
    ]
