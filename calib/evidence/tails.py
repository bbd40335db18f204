"""Logarithms of tail probabilities of chi-square, fast for many values, never underflowing."""

import math
from functools import lru_cache

import numpy as np

from calib.arrays import Array
from calib.chance import chi2_above

TABLE_END = 300.0
"""Chi-square up to which values are interpolated in a table."""
SMALLEST = 1e-200
"""Probability below which logarithms are worked out without the probability itself."""


def log_tail(chi2: Array, dof: float) -> Array:
    """log P(chi-square with ``dof`` degrees of freedom > chi2), to 1e-4; 0 for no freedom."""
    if dof == 0:
        return np.zeros_like(chi2)
    roots, table, end = _table(dof)
    answer = np.interp(np.sqrt(np.maximum(chi2, 0.0)), roots, table)
    far = chi2 > end
    if far.any():
        answer[far] = _far_tail(chi2[far], dof)
    return answer


@lru_cache(maxsize=1024)
def _table(dof: float) -> tuple[Array, Array, float]:
    """Square roots of chi-square, log tail at them, and the end of the table."""
    end = TABLE_END + 2.0 * dof
    roots = np.linspace(0.0, np.sqrt(end), max(600, int(20.0 * np.sqrt(end))))
    tail = chi2_above(dof, roots**2)
    small = tail < SMALLEST
    logs = np.log(np.where(small, 1.0, tail))
    logs[small] = _far_tail(roots[small] ** 2, dof)
    return roots, logs, end


def _far_tail(chi2: Array, dof: float) -> Array:
    """Far from the mean: Gamma(a, x) = x^(a-1) e^-x / (1 - (a-1)/(x - (a-3) - ...)), a = dof/2.

    Lentz's continued fraction x + 1 - a - 1(1 - a)/(x + 3 - a - ...), Abramowitz & Stegun 6.5.31
    in its even form, which converges within a few terms for x well above a, and within some
    sqrt(a) of them nearer by.
    """
    a, x = 0.5 * dof, 0.5 * chi2
    fraction = np.zeros_like(x)
    for term in range(40 + int(np.sqrt(a)), 0, -1):
        fraction = term * (term - a) / (x + 2.0 * term + 1.0 - a - fraction)
    return np.asarray(a * np.log(x) - x - math.lgamma(a) - np.log(x + 1.0 - a - fraction))


def log_any(log_p: Array, trials: float) -> Array:
    """log of the probability that one of ``trials`` independent looks reaches p: 1 - (1-p)^n."""
    p = np.exp(np.minimum(log_p, -1e-12))
    exact = np.log(np.maximum(-np.expm1(trials * np.log1p(-p)), 1e-320))
    return np.where(log_p < -30.0, np.minimum(log_p + np.log(trials), 0.0), exact)


def looks(levels: Array, quantile: float = 0.9) -> float:
    """Effective number of independent looks behind maxima ``levels`` of -log p (draws,).

    n such that P(max < level) = (1 - e^-level)^n at the given quantile; at least one.
    """
    log_p = -quantile_of(levels, quantile)
    p = float(np.exp(max(log_p, np.log(SMALLEST))))
    if p >= 1.0:
        return 1.0
    return max(1.0, float(np.log(quantile) / np.log1p(-p)))


def quantile_of(values: Array, quantile: float) -> float:
    """numpy's quantile of (n,), interpolated, in a tenth of the time: thousands are asked for."""
    place = quantile * (values.size - 1)
    at = min(int(place), max(values.size - 2, 0))
    both = np.partition(values, (at, min(at + 1, values.size - 1)))
    low, high, part = float(both[at]), float(both[min(at + 1, values.size - 1)]), place - at
    return high - (high - low) * (1.0 - part) if part >= 0.5 else low + (high - low) * part
