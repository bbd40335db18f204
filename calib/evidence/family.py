"""Family-wise p-values: having looked at all candidates, periods and structures is paid for.

Two stages, both calibrated by the same null draws, in which candidates keep their correlations:

1. a candidate's best -log p over its own hypotheses and trials is turned into its own p by the
   effective number of looks n: 1 - (1 - p)^n (the look-elsewhere effect of a scan);
2. the smallest weighted p over all candidates is compared with the smallest one of each draw.

With D draws and the observation one of D + 1 exchangeable ones, P(p <= 0.05) is exactly 0.05 for
D = 399, whatever the correlations (Monte Carlo test, Barnard 1963). Beyond what draws can show,
the tail is continued as n times p, the union bound that becomes exact for small p.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.evidence.tails import log_any, looks

ALPHA = 0.05
"""Family-wise false alarm."""
ENOUGH = 10
"""Draws that must exceed the observation for their count to be used instead of the tail."""


@dataclass(frozen=True, eq=False)
class Family:
    """Weighted strengths -log(p / weight) of candidates in observation and draws.

    Attributes
    ----------
    strengths : (C, 1 + draws)
    own_log_p : (C,)
        log p of each candidate, its own scan paid for.
    highest : (draws,)
        Largest strength in each null draw.
    """

    strengths: Array
    own_log_p: Array
    highest: Array

    def log_p(self, strength: float) -> float:
        """log of the family-wise p-value that belongs to a strength."""
        draws = self.highest.size
        exceeding = int(np.sum(self.highest >= strength))
        counted = float(np.log((exceeding + 1) / (draws + 1)))
        if exceeding >= ENOUGH or draws < 2 * ENOUGH:
            return counted
        level = float(np.quantile(self.highest, 1.0 - ENOUGH / draws))
        tail = float(np.log(ENOUGH / draws)) - (strength - level)
        return min(tail, float(np.log((ENOUGH + 1) / (draws + 1))))

    def critical(self, alpha: float) -> float:
        """Strength that a candidate must exceed for a family-wise p of ``alpha``."""
        return float(np.quantile(self.highest, 1.0 - alpha, method="higher"))


def significant(log_p: float, alpha: float) -> bool:
    """Whether a p-value is no larger than ``alpha``; rounding of a count of draws aside."""
    return bool(log_p <= np.log(alpha) + 1e-9)


def p_of(log_p: float) -> float:
    """A p-value, no smaller than 1e-300."""
    return float(np.exp(max(log_p, -690.0)))


def family(levels: list[Array], weights: Array) -> Family:
    """Join candidates to a family.

    Parameters
    ----------
    levels : list of (1 + draws,)
        Largest -log p of each candidate, observation first.
    weights : (C,)
        Share of the false alarms that each may use, relative; equal for equal treatment.
    """
    log_p = np.array([log_any(-level, looks(level[1:])) for level in levels])
    strengths = np.log(weights / weights.mean())[:, None] - log_p
    return Family(strengths, log_p[:, 0], strengths[:, 1:].max(axis=0))
