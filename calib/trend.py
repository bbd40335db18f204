"""What changed between two estimates more than chance, and where a series of estimates goes.

Many parameters are looked at together, so every p-value is paid for by their number (Sidak).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CHANCE = 0.05
"""Family-wise p-value below which a change is called one."""


def family_wise(z: float, among: int) -> float:
    """Chance that the largest of ``among`` independent standard normals is as far out as ``z``."""
    alone = math.erfc(abs(z) / math.sqrt(2.0))
    return -math.expm1(among * math.log1p(-alone)) if alone < 1.0 else 1.0


@dataclass(frozen=True)
class Change:
    """Difference of two estimates with its standard uncertainty, and its family-wise p-value."""

    value: float
    sigma: float
    p_value: float

    @property
    def clear(self) -> bool:
        """Whether it is more than chance."""
        return self.p_value < CHANCE


def change(earlier: tuple[float, float], later: tuple[float, float], among: int) -> Change:
    """Compare two independent estimates, each (value, sigma), one parameter of ``among``."""
    value, sigma = later[0] - earlier[0], math.hypot(earlier[1], later[1])
    z = value / sigma if sigma > 0.0 else (0.0 if value == 0.0 else math.inf)
    return Change(value, sigma, family_wise(z, among))


@dataclass(frozen=True)
class Drift:
    """A straight line through estimates: rate per unit of time, its sigma, family-wise p-value.

    ``last`` is the line's value at the last time. Where the estimates scatter about the line more
    than they state, ``sigma`` is as large as the scatter asks for.
    """

    rate: float
    sigma: float
    p_value: float
    last: float

    @property
    def clear(self) -> bool:
        """Whether it drifts more than chance."""
        return self.p_value < CHANCE

    def reaches(self, low: float, high: float) -> float:
        """Time from the last estimate until the line leaves [low, high]; inf if never."""
        if not low <= self.last <= high:
            return 0.0
        if self.rate == 0.0:
            return math.inf
        return ((high if self.rate > 0.0 else low) - self.last) / self.rate


def drift(
    times: Sequence[float], values: Sequence[float], sigmas: Sequence[float], among: int
) -> Drift | None:
    """Fit a line to estimates, weighted by their sigmas; one parameter of ``among``.

    Returns
    -------
    Drift or None
        None for fewer than three estimates, or all at one time.
    """
    t, x, s = (np.asarray(column, dtype=float) for column in (times, values, sigmas))
    if t.size < 3 or np.ptp(t) == 0.0 or not np.all(s > 0.0):
        return None
    design = np.stack([np.ones_like(t), t - t[-1]]) / s
    normal = np.linalg.inv(design @ design.T)
    last, rate = normal @ (design @ (x / s))
    left = x / s - np.array([last, rate]) @ design
    scatter = max(1.0, float(left @ left) / (t.size - 2))
    sigma = math.sqrt(normal[1, 1] * scatter)
    return Drift(float(rate), sigma, family_wise(float(rate) / sigma, among), float(last))
