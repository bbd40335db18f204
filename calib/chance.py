"""How likely chance alone goes so far: tails of distributions.

scipy's special functions, loaded when the first is asked for: they take as long to load as a
short fit takes in all, and most fits are decided without them.
"""

import math

import numpy as np

from calib.arrays import Array


def chi2_above(dof: float, chi2: Array | float) -> Array:
    """P(chi-square of ``dof`` degrees of freedom > chi2), each."""
    from scipy import special

    return np.asarray(special.chdtrc(dof, chi2))


def log_chi2_above(dof: float, chi2: float) -> float:
    """log P(chi-square of ``dof`` > 0 degrees of freedom > chi2), in elementary functions.

    The series of the lower incomplete gamma function below its mean and the continued fraction of
    the upper one above it (Abramowitz & Stegun 6.5.29, 6.5.31): no scipy, and no underflow.
    """
    a, x = 0.5 * dof, 0.5 * chi2
    if x <= 0.0:
        return 0.0
    front = a * math.log(x) - x - math.lgamma(a)
    if x > a + 1.0:
        fraction = 0.0
        for term in range(60 + int(10.0 * math.sqrt(a)), 0, -1):
            fraction = term * (term - a) / (x + 2.0 * term + 1.0 - a - fraction)
        return front - math.log(x + 1.0 - a - fraction)
    total = part = 1.0 / a
    k = 0
    while part > 1e-17 * total:
        k += 1
        part *= x / (a + k)
        total += part
    return math.log1p(-min(math.exp(front) * total, 1.0 - 1e-16))


def chi2_below(dof: float, chi2: float) -> float:
    """P(chi-square of ``dof`` degrees of freedom < chi2)."""
    from scipy import special

    return float(special.chdtr(dof, chi2))


def f_above(own: float, others: float, ratio: float) -> float:
    """P(F > ratio): mean square of ``own`` degrees of freedom over that of ``others``."""
    from scipy import special

    return float(special.fdtrc(own, others, ratio))


def f_above_at_least(own: int, others: float, ratio: float) -> float:
    """A bound that :func:`f_above` is never below, in elementary functions.

    F = (chi-square of ``own`` / own) / V. Two of ``own`` components exceed less often than all,
    and for two P(chi-square > own ratio V) = E exp(-own ratio V / 2) is a power. For one it is
    E erfc(sqrt(ratio V / 2)), convex in V with E V = 1: no less than erfc(sqrt(ratio / 2)).
    """
    if own == 1:
        return math.erfc(math.sqrt(0.5 * ratio))
    return float((1.0 + own * ratio / others) ** (-0.5 * others))


def f_rarer_than(chance: float, own: int, others: float, ratio: float) -> bool:
    """Whether P(F > ratio) is no more than ``chance``; mostly decided by the bound alone."""
    if f_above_at_least(own, others, ratio) > chance:
        return False
    return f_above(own, others, ratio) <= chance


def poisson_at_least(count: int, mean: float) -> float:
    """P(at least ``count`` where ``mean`` are expected), count >= 1."""
    from scipy import special

    return float(special.gammainc(count, mean))


def log_normal_below(z: Array) -> Array:
    """log P(standard normal < z), each; never underflowing."""
    from scipy import special

    return np.asarray(special.log_ndtr(z))
