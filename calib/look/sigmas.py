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
MILLIMETRES = 2.5
"""Stated sigma, mm, from which on um are tried whatever the readings scatter by."""
FINEST_MM = 2e-4
"""Stated sigma, mm, below which no tracker reads."""
TOO_QUIET, TOO_LOUD = 0.3, 30.0
"""Scatter over stated sigmas beyond which these may be another unit."""
THOUSAND = (300.0, 3000.0)
"""Ratios that are a unit a thousand times as large, and not another mistake."""


def sigmas(run: Run) -> tuple[Run, list[Remark]]:
    """Read rows whose uncertainties are a thousand times those of the others in their unit."""
    run, remarks = _one_axis(run)
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("iin->in", run.covariance))
    size = sigma.max(axis=0)
    plausible = run.measured & (size < ABSURD_MM)
    if not plausible.any() or not run.measured.any():
        return run, remarks
    usual = float(np.median(sigma[:, plausible]))
    ratio = np.where(run.measured, sigma / usual, 1.0)
    large = np.any(ratio > FAR, axis=0) & (size > ABSURD_MM)
    small = np.any(ratio < 1.0 / FAR, axis=0)
    for odd, factor, unit in ((large, 1e-3, "um"), (small, 1e3, "m")):
        if odd.any():
            run, remark = _odd(run, odd, factor, unit, usual)
            remarks.append(remark)
    return run, remarks


def _one_axis(run: Run) -> tuple[Run, list[Remark]]:
    """Read one of sx, sy, sz that is a thousand times the others in all rows in its unit."""
    if not run.measured.any():
        return run, []
    usual = np.sqrt(np.median(np.einsum("iin->in", run.covariance[:, :, run.measured]), axis=1))
    for axis, name in enumerate(("sx", "sy", "sz")):
        others = np.delete(usual, axis)
        ratio = usual[axis] / float(np.sqrt(others[0] * others[1]))
        for factor, unit in ((1e-3, "um"), (1e3, "m")):
            if 0.3 < factor * ratio < 3.0 and others.max() < ABSURD_MM:
                scale = np.ones(3)
                scale[axis] = factor
                covariance = run.covariance * np.outer(scale, scale)[:, :, None]
                return replace(run, covariance=covariance), [_axis_remark(run, name, unit, usual)]
    return run, []


def _axis_remark(run: Run, name: str, unit: str, usual: Array) -> Remark:
    return Remark(
        f"sigma-in-{unit}",
        f"{name} looks like {unit}, the other two are in mm",
        (),
        f"Usual values are {usual[0]:.3g}, {usual[1]:.3g} and {usual[2]:.3g} along x, y, z",
        f"{name} is read as {unit}",
        "Write sx, sy, sz in mm",
        True,
        run.source,
    )


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


def in_um(run: Run) -> OtherUnit | None:
    """The run with its uncertainties read in um, where they are millimetres as they stand."""
    if not run.measured.any():
        return None
    variances = np.einsum("iin->in", run.covariance[:, :, run.measured])
    sigma = float(np.sqrt(np.median(variances)))
    if sigma < MILLIMETRES:
        return None
    remark = Remark(
        "sigma-in-um",
        f"sx, sy, sz look like um: {sigma:.3g} means {sigma:.3g} mm",
        (),
        "No tracker reads so badly; read in um they are what the rest of the record bears out",
        "Read as um",
        "Write sx, sy, sz in mm",
        True,
        run.source,
    )
    return OtherUnit(replace(run, covariance=1e-6 * run.covariance), remark)


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
