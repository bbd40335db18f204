"""Stated uncertainties in another unit: those of some rows, or those of all."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

FAR = 300.0
"""Ratio to the median of the good ones from which on a sigma is another unit."""
ABSURD_MM = 0.3
"""Stated sigma, mm, that no laser tracker has."""
FINEST_MM = 2e-4
"""Stated sigma, mm, below which no tracker reads."""
TOO_QUIET, TOO_LOUD = 0.3, 30.0
"""Scatter over stated sigmas beyond which these may be another unit."""
THOUSAND = (300.0, 3000.0)
"""Ratios that are a unit a thousand times as large, and not another mistake."""


def sigmas(run: Run) -> tuple[Run, list[Remark]]:
    """Read rows whose uncertainties are a thousand times those of the others in their unit."""
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("iin->in", run.covariance))
    size = sigma.max(axis=0)
    plausible = run.measured & (size < ABSURD_MM)
    if not plausible.any() or not run.measured.any():
        return run, []
    usual = float(np.median(sigma[:, plausible]))
    ratio = np.where(run.measured, sigma / usual, 1.0)
    large = np.any(ratio > FAR, axis=0) & (size > ABSURD_MM)
    small = np.any(ratio < 1.0 / FAR, axis=0)
    remarks = []
    for odd, factor, unit in ((large, 1e-3, "um"), (small, 1e3, "m")):
        if odd.any():
            run, remark = _odd(run, odd, factor, unit, usual)
            remarks.append(remark)
    return run, remarks


def _odd(run: Run, odd: BoolArray, factor: float, unit: str, usual: float) -> tuple[Run, Remark]:
    lines = ranges(run.line[odd], run.line[run.measured])
    here = float(np.median(np.sqrt(np.einsum("iin->in", run.covariance[:, :, odd]))))
    readable = THOUSAND[0] < max(here / usual, usual / here) < THOUSAND[1]
    if readable:
        run = replace(run, covariance=np.where(odd, factor**2, 1.0) * run.covariance)
    look = f" (they look like {unit})" if readable else ""
    return run, Remark(
        "sigma-unit-in-rows",
        f"sx, sy or sz in {lines_in_words(lines)} are {here / usual:.3g} times those of the "
        f"other readings{look}",
        lines,
        f"{here:.4g} mm where the others have {usual:.4g} mm",
        f"Read as {unit}"
        if readable
        else "Taken as they stand: such readings weigh nothing, or everything",
        "Write sx, sy, sz in mm",
        readable,
        run.source,
    )


@dataclass(frozen=True)
class OtherUnit:
    """The run with its uncertainties read in another unit, and what is said of it."""

    run: Run
    remark: Remark


def sigmas_of_all(run: Run, sigma: float, scatter: float) -> OtherUnit | None:
    """The unit in which the stated sigmas would be what the readings scatter by.

    Parameters
    ----------
    run : Run
    sigma : float
        Their median, mm.
    scatter : float
        Of the readings after a fit, in stated sigmas.
    """
    if scatter < TOO_QUIET and sigma > ABSURD_MM:
        return _read_as(run, sigma, scatter, "um", 1e-6 * run.covariance)
    if scatter < TOO_LOUD or sigma > FINEST_MM:
        return None
    variances = np.sqrt(np.abs(run.covariance))
    tried: dict[str, tuple[float, Array]] = {
        "m": (1e3, 1e6 * run.covariance),
        "variances in mm^2": (sigma**-0.5, np.eye(3)[:, :, None] * variances),
    }
    unit = min(tried, key=lambda name: abs(np.log(tried[name][0] / scatter)))
    return _read_as(run, sigma, scatter, unit, tried[unit][1])


def _read_as(run: Run, sigma: float, scatter: float, unit: str, covariance: Array) -> OtherUnit:
    names = {"um": "sigma-in-um", "m": "sigma-in-m"}
    remark = Remark(
        names.get(unit, "sigma-is-variance"),
        f"sx, sy, sz look like {unit}: {sigma:.3g} means {sigma:.3g} mm",
        (),
        f"The readings scatter {scatter:.2g} times as much as that says",
        f"Read as {unit}",
        "Write sx, sy, sz in mm",
        True,
        run.source,
    )
    return OtherUnit(replace(run, covariance=covariance), remark)
