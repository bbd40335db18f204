"""Every hypothesis in the observed residual and in fits where nothing is missing.

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
from scipy import linalg

from calib.arrays import Array
from calib.discover.candidate import Candidate
from calib.discover.problem import LinearProblem
from calib.discover.tails import log_tail

BLIND = 1e-8
"""Directions of which less than this (squared norm after / before projection) is left are lost."""
LEADING = 0.25
"""Directions in which a group moves the readings by less than this part of the most it can do."""


@dataclass(frozen=True, eq=False)
class Weighing:
    """Whitening of one hypothesis at every trial: a = whiten @ s.

    ``whiten`` (T, k, k), rows of directions that are not seen are zero; ``dof`` (T,).
    """

    subset: tuple[int, ...]
    whiten: Array
    dof: Array


@dataclass(eq=False)
class Scores:
    """Scores of all candidates in the observation (draw 0) and in null draws 1...

    Attributes
    ----------
    problem : LinearProblem
    candidates : sequence of Candidate
    residuals : (R, 1 + draws)
        Observed residual first.
    norms : list of (T, k)
        Norm of each column before projection.
    units : list of (T, k, R)
        Columns divided by their norms.
    scores : list of (T, k, 1 + draws)
        Unit columns times residuals.
    weights : list of (T, k, k)
        Unit columns times M times unit columns.
    """

    problem: LinearProblem
    candidates: Sequence[Candidate]
    residuals: Array
    norms: list[Array]
    units: list[Array]
    scores: list[Array]
    weights: list[Array]
    remembered: dict[int, tuple[float, list[Array]]] = field(default_factory=dict, repr=False)
    """Evidence of the observation by candidate, kept by :mod:`calib.discover.evidence`."""

    @cached_property
    def squares(self) -> Array:
        """|e|^2 of every draw."""
        return np.asarray(np.einsum("rd,rd->d", self.residuals, self.residuals))

    @cached_property
    def weighings(self) -> list[list[Weighing]]:
        """For every candidate the whitening of each of its hypotheses; then its leading part."""
        found = []
        for candidate, weight, norm in zip(self.candidates, self.weights, self.norms, strict=True):
            weighings = [_weigh(weight, subset) for subset in candidate.hypotheses]
            leading = _leading(weight, norm * candidate.sizes)
            if np.any(leading.dof < weighings[0].dof):
                weighings.append(leading)
            found.append(weighings)
        return found

    @cached_property
    def levels(self) -> list[Array]:
        """For every candidate the largest -log p over its hypotheses and trials, (1 + draws,)."""
        return [self.level(index, scores, self.squares) for index, scores in enumerate(self.scores)]

    def level(self, index: int, scores: Array, squares: Array) -> Array:
        """Largest -log p of a candidate for given scores (T, k, D) and |e|^2 (D,)."""
        best = np.zeros(scores.shape[-1])
        for weighing in self.weighings[index]:
            chi2 = chi_squares(weighing, scores)
            for dof in np.unique(weighing.dof):
                if dof == 0:
                    continue
                here = chi2[weighing.dof == dof]
                left = np.maximum(squares - here, 0.0) / max(self.problem.trace - dof, 1.0)
                judged = (here / np.maximum(left, 1.0)).max(axis=0)
                best = np.maximum(best, -log_tail(judged, int(dof)))
        return best

    @cached_property
    def noise(self) -> float:
        """Standard deviation of a reading, in sigmas: 1, or what the best explanation leaves.

        With more missing than one effect, what one leaves is noise to the comparison of two.
        """
        left = [float(self.squares[0]) / max(self.problem.trace, 1.0)]
        for index, weighings in enumerate(self.weighings):
            for weighing in weighings:
                chi2 = chi_squares(weighing, self.scores[index][:, :, :1])[:, 0]
                dof = np.maximum(self.problem.trace - weighing.dof, 1.0)
                left.append(float(np.min((self.squares[0] - chi2) / dof)))
        return float(np.sqrt(max(1.0, min(left))))

    def without(self, columns: Array, precision: Array, rng: np.random.Generator) -> "Scores":
        """Scores after ``columns`` (k, R) with prior ``precision`` (k,) have joined the fit.

        With g = (A M A^T + Lambda)^-1/2 A M the larger fit has M' = M - g^T g and
        e' = e - g^T (A M A^T + Lambda)^-1/2 (A e + Lambda^1/2 xi), xi = 0 in the observation.
        """
        projected = self.problem.project(columns)
        weight = columns @ projected.T + np.diag(precision)
        scale = 1.0 / np.sqrt(np.diag(weight))
        factor = linalg.cholesky(weight * scale[:, None] * scale, lower=True)
        half = linalg.solve_triangular(factor, np.diag(scale), lower=True)
        taken = half @ projected
        prior = np.sqrt(precision)[:, None] * rng.standard_normal(
            (precision.size, self.residuals.shape[1])
        )
        prior[:, 0] = 0.0
        pulled = half @ (columns @ self.residuals + prior)
        scores, weights = [], []
        for index, old in enumerate(self.scores):
            unit = self.units[index]
            cross = (unit.reshape(-1, unit.shape[2]) @ taken.T).reshape(*unit.shape[:2], -1)
            scores.append(old - cross @ pulled)
            weights.append(self.weights[index] - cross @ np.swapaxes(cross, 1, 2))
        return Scores(
            problem=self.problem.with_columns(columns, precision),
            candidates=self.candidates,
            residuals=self.residuals - taken.T @ pulled,
            norms=self.norms,
            units=self.units,
            scores=scores,
            weights=weights,
        )

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


def score(
    problem: LinearProblem, candidates: Sequence[Candidate], rng: np.random.Generator, draws: int
) -> Scores:
    """Score candidates in the observed residual and in ``draws`` fits with nothing missing."""
    residuals = np.concatenate(
        [problem.residual[:, None], problem.null_residuals(draws, rng)], axis=1
    )
    norms, units, scores, weights = [], [], [], []
    for candidate in candidates:
        norm = np.sqrt(np.einsum("tkr,tkr->tk", candidate.columns, candidate.columns))
        unit = candidate.columns / np.where(norm > 0.0, norm, 1.0)[:, :, None]
        flat = unit.reshape(-1, problem.rows)
        absorbed = (flat @ problem.absorbed.T).reshape(*norm.shape, -1)
        norms.append(norm)
        units.append(unit)
        scores.append((flat @ residuals).reshape(*norm.shape, -1))
        weights.append(unit @ np.swapaxes(unit, 1, 2) - absorbed @ np.swapaxes(absorbed, 1, 2))
    return Scores(problem, list(candidates), residuals, norms, units, scores, weights)


def _weigh(weight: Array, subset: tuple[int, ...]) -> Weighing:
    """V^-1/2 of a hypothesis at every trial, from weights (T, k, k); unseen directions dropped."""
    chosen = np.array(subset, dtype=np.intp)
    values, vectors = np.linalg.eigh(weight[:, chosen[:, None], chosen])
    seen = values > BLIND * chosen.size
    inverse = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
    whiten = np.swapaxes(vectors, 1, 2) * inverse[:, :, None]
    return Weighing(subset, whiten, seen.sum(axis=1))


def _leading(weight: Array, size: Array) -> Weighing:
    """The whole group without directions in which it hardly moves the readings.

    In units of the unknowns' sizes (T, k) the readings see them along the eigenvectors of D V D.
    Where a group of many is seen along few directions (two dozen joint tilts along six), the rest
    adds degrees of freedom and no signal; amplitudes of like size show along the leading ones.
    """
    scaled = weight * size[:, :, None] * size[:, None, :]
    values, vectors = np.linalg.eigh(scaled)
    seen = values > LEADING**2 * np.maximum(values[:, -1:], 1e-300)
    inverse = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
    whiten = np.swapaxes(vectors * size[:, :, None], 1, 2) * inverse[:, :, None]
    return Weighing(tuple(range(weight.shape[1])), whiten, seen.sum(axis=1))


def chi_squares(weighing: Weighing, scores: Array) -> Array:
    """Fall of chi-square (T, D) by a hypothesis, from its candidate's scores (T, k, D)."""
    whitened = weighing.whiten @ scores[:, list(weighing.subset)]
    return np.asarray(np.einsum("tkd,tkd->td", whitened, whitened))
