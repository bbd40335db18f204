"""Scores of candidates as numbers, and what they say of each.

For a hypothesis with columns A (k, R) the score s = A e has covariance V = A M A^T under the null;
whitened, a = V^-1/2 s, the statistic |a|^2 is chi-square with k degrees of freedom: it is the fall
of chi-square if the hypothesis were added to the fit.

**Noise.** Readings have stated sigmas. They are trusted unless the data prove them too small: a
hypothesis is judged against s^2 = max(1, (|e|^2 - |a|^2) / (tr M - k)), what is left *after* it.
A right effect leaves 1, so this costs it nothing; readings that all scatter more than they claim
do not pass for an effect. The null draws go through the same arithmetic, which keeps the false
alarm exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from calib.arrays import Array
from calib.evidence.candidate import Candidate
from calib.evidence.tails import log_any, log_tail, looks
from calib.evidence.weighed import Weighed
from calib.evidence.weighing import Stack, chi_squares


@dataclass(eq=False, kw_only=True)
class Scored:
    """Scores of all candidates in the observation (draw 0) and in null draws 1...

    Attributes
    ----------
    weighed : Weighed
        Candidates, norms of their columns, and weights.
    scores : list of (T, k, 1 + draws)
        Unit columns times residuals.
    squares : (1 + draws,)
        |e|^2 of every draw.
    trace : float
        tr M, the degrees of freedom left.
    """

    weighed: Weighed
    scores: list[Array]
    squares: Array
    trace: float
    remembered: dict[int, tuple[float, list[Array]]] = field(default_factory=dict, repr=False)
    """Evidence of the observation by candidate, kept by :mod:`calib.evidence.bayes`."""

    @property
    def candidates(self) -> Sequence[Candidate]:
        """What is asked."""
        return self.weighed.candidates

    @property
    def norms(self) -> list[Array]:
        """Norm of each column before projection, (T, k) of each candidate."""
        return self.weighed.norms

    @property
    def weights(self) -> list[Array]:
        """Unit columns times M times unit columns, (T, k, k) of each candidate."""
        return self.weighed.weights

    @cached_property
    def _both(self) -> list[tuple[Array, Array | None]]:
        """For every candidate -log p (1 + draws,) by its best hypothesis, and by its soft test."""
        return [self._apart(index, found, self.squares) for index, found in enumerate(self.scores)]

    @cached_property
    def _looks(self) -> list[tuple[float, float]]:
        """For every candidate how many independent looks the two tests take."""
        return [
            (looks(best[1:]), 1.0 if soft is None else looks(soft[1:])) for best, soft in self._both
        ]

    @cached_property
    def levels(self) -> list[Array]:
        """For every candidate its -log p, (1 + draws,), the observation first."""
        return [self._joined(index, *both) for index, both in enumerate(self._both)]

    def level(self, index: int, scores: Array, squares: Array) -> Array:
        """-log p of a candidate for given scores (T, k, D) and |e|^2 (D,).

        By its best hypothesis and trial, or by the soft test of the whole group where that is
        smaller: a maximum over parts is weak where many unknowns act, the soft test where one does.
        Each pays for its own looks.
        """
        return self._joined(index, *self._apart(index, scores, squares))

    def _joined(self, index: int, best: Array, soft: Array | None) -> Array:
        if soft is None:
            return best
        own, other = self._looks[index]
        return np.maximum(-log_any(-best, own), -log_any(-soft, other))

    def _apart(self, index: int, scores: Array, squares: Array) -> tuple[Array, Array | None]:
        best = np.zeros(scores.shape[-1])
        for stack in self.weighed.stacks[index]:
            best = np.maximum(best, self._largest(stack, scores, squares))
        soft = self.weighed.softs[index]
        return best, None if soft is None else self._largest(soft, scores, squares)

    def _largest(self, stack: Stack, scores: Array, squares: Array) -> Array:
        """Largest -log p (D,) over the hypotheses of a stack and their trials.

        What is judged rises with the fall of chi-square: of equal degrees of freedom the largest
        fall is the best.
        """
        best = np.zeros(scores.shape[-1])
        for dof, here in stack.largest(scores):
            left = (squares - here) / max(self.trace - dof, 1.0)
            judged = here / np.maximum(left, 1.0)
            best = np.maximum(best, -log_tail(judged, dof))
        return best

    @cached_property
    def noise(self) -> float:
        """Standard deviation of a reading, in sigmas: 1, or what the best explanation leaves.

        With more missing than one effect, what one leaves is noise to the comparison of two.
        """
        left = [float(self.squares[0]) / max(self.trace, 1.0)]
        for scores, stacks in zip(self.scores, self.weighed.stacks, strict=True):
            for stack in stacks:
                chi2 = stack.chi_squares(scores[:, :, :1])[:, 0]
                dof = np.maximum(self.trace - stack.dof.reshape(-1), 1.0)
                left.append(float(np.min((self.squares[0] - chi2) / dof)))
        return float(np.sqrt(max(1.0, min(left))))

    def fall(self, index: int, number: int, trial: int) -> tuple[float, int]:
        """Fall of chi-square by a hypothesis in the observation, and its degrees of freedom."""
        weighing = self.weighed.weighing(index, number)
        seen = chi_squares(weighing, self.scores[index][:, :, :1])[trial, 0]
        return float(seen), int(weighing.dof[trial])

    def estimate(self, index: int, trial: int, subset: tuple[int, ...]) -> tuple[Array, Array]:
        """Values (k,) and covariance (k, k) of a hypothesis's unknowns, with their own priors."""
        chosen = list(subset)
        norm = self.norms[index][trial, chosen]
        norm = np.where(norm > 0.0, norm, 1.0)
        candidate = self.candidates[index]
        weight = self.weights[index][trial][np.ix_(chosen, chosen)].copy()
        weight += np.diag(candidate.prior_precision[chosen] / norm**2)
        covariance = np.linalg.inv(weight)
        beta = covariance @ self.scores[index][trial, chosen, 0]
        return beta / norm, covariance / (norm[:, None] * norm)
