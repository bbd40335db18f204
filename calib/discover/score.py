"""Score tests: what would a set of columns explain of the residual, beyond what is fitted?

Nothing here knows a machine. Given are whitened residuals e (n,) at the optimum of a fit with
Jacobian J (p, n) and prior precisions (p,), and the columns C (u, n) of a candidate. What the fit
would absorb is projected out (Frisch and Waugh; priors enter as p more rows):

    M = C C^T - (J C^T)^T (J J^T + D)^-1 (J C^T),   b = C e,   drop = b^T M^-1 b.

With known noise ``drop`` is the fall of chi-square by adding the candidate, and is distributed as
chi-square with rank(M) degrees of freedom if nothing is hidden; with unknown noise it enters an F
ratio against what is left. A candidate may be tried at several values of its nonlinear unknowns
and in parts (one leg alone): what that look-elsewhere costs is measured on simulated residuals of
the same fit (:class:`Null`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from calib.arrays import Array
from calib.discover.tails import effective_tries, log_chi2_tail, log_f_tail, log_of_any

BLIND = 1e-4
"""A direction is invisible when less than this part of its norm survives the projection."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A fit at its optimum.

    Attributes
    ----------
    residual : (n,)
        Whitened; with ``known_scale`` False in any common unit.
    jacobian : (p, n)
        Whitened derivatives of the prediction by what is fitted.
    precision : (p,)
        1 / sigma^2 of priors; zero where there is none.
    known_scale : bool
        Whether residuals are in standard deviations.
    """

    residual: Array
    jacobian: Array
    precision: Array
    known_scale: bool = True

    @cached_property
    def factor(self) -> Array:
        """Lower Cholesky factor of J J^T + D."""
        normal = self.jacobian @ self.jacobian.T
        normal[np.diag_indices_from(normal)] += self.precision
        return np.asarray(linalg.cholesky(normal, lower=True))

    @property
    def dof(self) -> float:
        """Dimension of the space of residuals, priors included."""
        return float(self.residual.size + np.sum(self.precision > 0) - self.precision.size)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A set of columns with a name.

    Attributes
    ----------
    name : str
    columns : (T, u, n)
        Whitened, at T trial values of the nonlinear unknowns.
    parts : tuple of tuple of int
        Groups of the u columns that may act alone; tested beside the whole.
    """

    name: str
    columns: Array
    parts: tuple[tuple[int, ...], ...] = ()

    @cached_property
    def blocks(self) -> tuple[tuple[int, ...], ...]:
        """The whole and its parts, as indices into u."""
        whole = tuple(range(self.columns.shape[1]))
        return (whole, *(part for part in self.parts if part != whole))


@dataclass(frozen=True, eq=False)
class Score:
    """How a candidate does.

    Attributes
    ----------
    log_p : float
        Log p-value of the candidate by itself, its trials and parts paid for.
    drop : float
        Fall of chi-square (or of the sum of squares) with all its columns, at the best trial.
    dof : int
        Rank of the best block; ``rank`` that of all columns.
    trial : int
        Best trial.
    part : tuple of int
        Best block.
    amplitudes, covariance : (u,), (u, u)
        Estimates with all columns at the best trial, in the columns' units; for unknown noise the
        covariance is in units of its square.
    """

    name: str
    log_p: float
    drop: float
    dof: int
    rank: int
    trial: int
    part: tuple[int, ...]
    amplitudes: Array
    covariance: Array


class Reduced:
    """A candidate's columns with everything fitted projected out."""

    def __init__(self, problem: Problem, candidate: Candidate) -> None:
        trials, unknowns, n = candidate.columns.shape
        self.candidate = candidate
        flat = candidate.columns.reshape(-1, n)
        absorbed = linalg.solve_triangular(problem.factor, problem.jacobian @ flat.T, lower=True)
        self.absorbed = absorbed.T.reshape(trials, unknowns, -1)
        raw = candidate.columns @ candidate.columns.transpose(0, 2, 1)
        self.gram = raw - self.absorbed @ self.absorbed.transpose(0, 2, 1)
        norm = np.sqrt(np.maximum(np.einsum("tuu->tu", raw), 1e-300))
        self.roots: list[Array] = []
        """For each block (T, r, u_b): maps scores to independent unit normals."""
        self.ranks: list[Array] = []
        for block in candidate.blocks:
            index = np.array(block)
            own = norm[:, index]
            scaled = self.gram[:, index[:, None], index] / (own[:, :, None] * own[:, None, :])
            values, vectors = np.linalg.eigh(scaled)
            seen = values > BLIND**2
            inverse = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
            self.roots.append(inverse[:, :, None] * (vectors / own[:, :, None]).transpose(0, 2, 1))
            self.ranks.append(seen.sum(axis=1))

    def drops(self, scores: Array) -> list[Array]:
        """Fall of chi-square (T, S) of every block for scores (T, u, S)."""
        return [
            np.sum((root @ scores[:, np.array(block)]) ** 2, axis=1)
            for root, block in zip(self.roots, self.candidate.blocks, strict=True)
        ]

    def scores(self, residual: Array) -> Array:
        """Scores (T, u, S) of residuals (n, S)."""
        trials, unknowns, n = self.candidate.columns.shape
        flat = self.candidate.columns.reshape(-1, n) @ residual
        return flat.reshape(trials, unknowns, -1)

    @property
    def tried(self) -> bool:
        """Whether more than one block is tried."""
        return sum(int(np.count_nonzero(ranks)) for ranks in self.ranks) > 1


def _log_tail(problem: Problem, drop: Array, dof: Array, total: Array) -> Array:
    if problem.known_scale:
        return log_chi2_tail(drop, dof)
    rest = problem.dof - dof
    ratio = (drop / np.maximum(dof, 1)) / (np.maximum(total - drop, 1e-300) / rest)
    return log_f_tail(ratio, dof, rest)


def _smallest(problem: Problem, reduced: Reduced, drops: list[Array], total: Array) -> Array:
    """Smallest log p (S,) over trials and blocks."""
    best = np.zeros(total.size)
    for ranks, drop in zip(reduced.ranks, drops, strict=True):
        for rank in np.unique(ranks):
            if rank:
                largest = drop[ranks == rank].max(axis=0)
                best = np.minimum(best, _log_tail(problem, largest, np.array(rank), total))
    return best


class Null:
    """What scores would be if nothing were hidden: simulated residuals of the same fit.

    Parameters
    ----------
    problem : Problem
    generator : numpy Generator
    draws : int
        Number S of simulated residuals.
    """

    def __init__(self, problem: Problem, generator: np.random.Generator, draws: int = 400) -> None:
        n, p = problem.residual.size, problem.precision.size
        noise = generator.standard_normal((n, draws))
        pulls = generator.standard_normal((p, draws)) * np.sqrt(problem.precision)[:, None]
        slope = problem.jacobian @ noise + pulls
        step = linalg.cho_solve((problem.factor, True), slope)
        self.residual = noise - problem.jacobian.T @ step
        pulled = np.where(problem.precision > 0, 1.0, 0.0)[:, None] * (
            pulls / np.sqrt(np.maximum(problem.precision, 1e-300))[:, None]
            - np.sqrt(problem.precision)[:, None] * step
        )
        self.total = np.sum(self.residual**2, axis=0) + np.sum(pulled**2, axis=0)

    def log_p(self, problem: Problem, reduced: Reduced) -> Array:
        """Smallest log p (S,) of a candidate in every simulated residual."""
        drops = reduced.drops(reduced.scores(self.residual))
        return _smallest(problem, reduced, drops, self.total)


@dataclass(frozen=True, eq=False)
class Price:
    """What looking costs: effective numbers of tries, by candidate and of the whole family."""

    tries: dict[str, float]
    family: float


def price(
    problem: Problem, reduced: Sequence[Reduced], null: Null, others: Sequence[Array] = ()
) -> Price:
    """Measure the look-elsewhere effect of every candidate, and of looking at all of them.

    ``others`` are log p-values (S,) of further tests in the same family on the same draws.
    """
    tries: dict[str, float] = {}
    smallest = [np.asarray(other) for other in others]
    for one in reduced:
        log_p = null.log_p(problem, one)
        tries[one.candidate.name] = effective_tries(np.exp(log_p)) if one.tried else 1.0
        smallest.append(log_of_any(log_p, tries[one.candidate.name]))
    family = effective_tries(np.exp(np.min(smallest, axis=0))) if smallest else 1.0
    return Price(tries, family)


def score(problem: Problem, reduced: Reduced, tries: float) -> Score:
    """Score one candidate against the residual."""
    scores = reduced.scores(problem.residual[:, None])
    drops = [drop[:, 0] for drop in reduced.drops(scores)]
    total = np.array(problem.residual @ problem.residual)
    best = (0.0, 0, 0)
    for index, (ranks, drop) in enumerate(zip(reduced.ranks, drops, strict=True)):
        log_p = _log_tail(problem, drop, ranks, total)
        trial = int(np.argmin(log_p))
        if log_p[trial] < best[0]:
            best = (float(log_p[trial]), trial, index)
    log_p_best, trial, index = best
    root = reduced.roots[0][trial]
    return Score(
        name=reduced.candidate.name,
        log_p=float(log_of_any(np.array(log_p_best), tries)),
        drop=float(drops[0][trial]),
        dof=int(reduced.ranks[index][trial]),
        rank=int(reduced.ranks[0][trial]),
        trial=trial,
        part=reduced.candidate.blocks[index],
        amplitudes=root.T @ (root @ scores[trial, :, 0]),
        covariance=root.T @ root,
    )
