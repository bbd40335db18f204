"""What the whole of the readings says beside any effect: runs at odds, uncertainties untrue.

Both are said in words. A fit of several runs shares the geometry; where each run alone is
explained and all together are not, the runs are of two machines, or of one that was changed.
"""

import math
from dataclasses import dataclass

import numpy as np

from calib.chance import chi2_above, chi2_below, f_above, log_chi2_above
from calib.digits import length
from calib.errors import BadInput
from calib.evidence.repeats import pure_error
from calib.identify.fitting import Fit
from calib.identify.staged import fit_effects
from calib.runs.stack import stack

BY_CHANCE = 1e-6
"""Probability of what is called no chance."""
TOGETHER_WORSE = 1.5
"""Chi-square per degree of freedom together, over that apart, from which runs are at odds."""
LOOSE = 1e-3
"""p-value below which base nests are not read as well as they should be."""
FEW_PAIRS = 10
"""Pairs of readings below which nothing is said of their likeness."""
SURELY = 4.5
"""Standard deviations of a correlation that is no chance (3e-6)."""
DOUBTED = 0.01
"""Probability of a fit's chi-square by noise alone, below which the fit says that it is doubted."""
TOO_SMALL, TOO_LARGE = 1.3, 0.7
"""Scatter in stated uncertainties beyond which these are called untrue."""


@dataclass(frozen=True)
class AtOdds:
    """Runs that disagree: RMS apart and together, mm."""

    apart_mm: float
    together_mm: float

    def __str__(self) -> str:
        return (
            f"The runs do not agree: each alone is explained to {length(self.apart_mm)}, "
            f"together only to {length(self.together_mm)}. They are of two machines, or the "
            "machine was changed between them: fit them apart"
        )


def runs_at_odds(fitted: Fit) -> AtOdds | None:
    """Tell whether several runs agree on one geometry (F test of sharing it).

    Parameters
    ----------
    fitted : Fit
        Of all runs together; its effects are fitted to each run alone too.
    """
    rows = fitted.model.rows
    if len(rows.runs) < 2 or not fitted.chi2_per_dof > TOGETHER_WORSE:
        return None
    apart = []
    for run in rows.runs:
        try:
            apart.append(fit_effects(stack(rows.machine, [run]), fitted.model.effects))
        except BadInput:  # a run that cannot stand alone says nothing about the others
            return None
    chi2, dof = sum(one.chi2 for one in apart), sum(one.dof for one in apart)
    readings = sum(one.readings for one in apart)
    shared = sum(one.trace_hat for one in apart) - fitted.trace_hat
    if dof <= 0 or shared <= 0 or fitted.chi2_per_dof < TOGETHER_WORSE * chi2 / dof:
        return None
    ratio = (fitted.chi2 - chi2) / shared / (chi2 / dof)
    if f_above(shared, dof, ratio) > BY_CHANCE:
        return None
    total = sum(one.readings * one.rms_mm**2 for one in apart)
    return AtOdds(math.sqrt(total / readings), fitted.rms_mm)


def loose_references(fitted: Fit) -> str:
    """Say if base nests scatter from reading to reading more than sx, sy, sz say; else empty."""
    rows = fitted.model.rows
    references = np.flatnonzero(fitted.accepted & ~rows.on_platform)
    found = pure_error(
        fitted.linear.whitened[:, references],
        [(int(rows.run[row]), rows.nest_name[row]) for row in references],
        fitted.dof,
    )
    if not found.dof or not found.p_value < LOOSE or not found.variance > 1.0:
        return ""
    return (
        f"But base nests scatter {math.sqrt(found.variance):.2g} times as much from reading to "
        f"reading as sx, sy, sz say (p = {found.p_value:.1g}): look for a loose one"
    )


def neighbours_alike(fitted: Fit) -> float | None:
    """Correlation of readings that follow each other, where it is no chance; else None."""
    rows, kept = fitted.model.rows, fitted.accepted
    residual, run = fitted.linear.whitened[:, kept], rows.run[kept]
    pair = np.flatnonzero(run[1:] == run[:-1])
    if fitted.whitening is not None or pair.size < FEW_PAIRS:
        return None
    first, second = residual[:, pair], residual[:, pair + 1]
    scale = math.sqrt(float(np.sum(first**2)) * float(np.sum(second**2)))
    alike = float(np.sum(first * second)) / scale if scale > 0.0 else 0.0
    return None if alike * math.sqrt(first.size) < SURELY else alike


def successive_alike(fitted: Fit) -> str:
    """Say if readings that follow each other err alike, while they are taken as independent."""
    alike = neighbours_alike(fitted)
    if alike is None:
        return ""
    return (
        f"Successive readings err alike ({alike:.2f} between two): noise that lasts, or an effect "
        "that is missing. The uncertainties take them as independent; pkmcal diagnose tells which"
    )


def log_chance(fitted: Fit) -> float | None:
    """log of the probability that noise alone leaves as much as the fit; None without freedom."""
    if not fitted.dof > 0:
        return None
    counted = fitted.chi2 if fitted.whitening is None else float(np.sum(fitted.whitened**2))
    return log_chi2_above(fitted.dof, counted)


def more_than_noise(fitted: Fit) -> str:
    """Say if a fit leaves more than the stated uncertainties do by chance; else empty."""
    log_p = log_chance(fitted)
    if log_p is None or log_p > math.log(DOUBTED):
        return ""
    return (
        "More is left than noise alone leaves: the machine file or the effects lack something, or "
        "the readings' uncertainties are stated too small; pkmcal diagnose tells which. The +- "
        "here count with what is stated: they are too small by a factor of "
        f"{math.sqrt(fitted.chi2_per_dof):.2g} if what is left is noise; if it is an effect, "
        "values may be off by more"
    )


def untrue_uncertainties(fitted: Fit) -> str:
    """Say if the readings scatter much more or much less than sx, sy, sz say; else empty."""
    if not fitted.dof > 0:
        return ""
    scatter = math.sqrt(fitted.chi2_per_dof)
    if scatter > TOO_SMALL and chi2_above(fitted.dof, fitted.chi2) < BY_CHANCE:
        return f"The readings scatter {scatter:.2g} times as much as sx, sy, sz say"
    if scatter < TOO_LARGE and chi2_below(fitted.dof, fitted.chi2) < BY_CHANCE:
        return f"The readings scatter only {scatter:.2g} times as much as sx, sy, sz say"
    return ""
