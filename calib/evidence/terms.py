"""Propose terms for what no known effect explains: sparse, and stable under resampling.

A library of small formulas is offered. The one with the most evidence joins the fit, the residual
is looked at again, and so on until none adds more than e^3 (sparse regression by forward
selection; the evidence pays for a formula's number of unknowns and of trials). The selection is
repeated on complementary halves of the poses (Shah and Samworth 2013): a term is stable if it, or
one that the readings cannot tell from it, is selected in most halves.

A half S of the readings has its own fit: with slope J_S e_S - J e (the gradient of the part left
out, priors included) its residual is e_S - J_S^T N_S^-1 (J_S e_S - J e).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.evidence.bayes import observed
from calib.evidence.candidate import Candidate
from calib.evidence.problem import LinearProblem
from calib.evidence.rounds import joining
from calib.evidence.scores import Scores, score

ENOUGH = 3.0
"""Log evidence that a term must add."""
PAIRS = 12
"""Complementary pairs of halves."""
STABLE = 0.6
"""Part of the halves in which a term must be selected."""
ALIKE = 0.9
"""Projected cosine above which one term stands for another."""
MOST_TERMS = 3


@dataclass(frozen=True, eq=False)
class Selected:
    """A term that the readings call for.

    Attributes
    ----------
    index : int
        Its place in the library.
    log_evidence : float
        What it added when it was selected.
    frequency : float
        Part of the halves of the poses in which it, or one like it, was selected.
    trial : tuple of float
        Values of its nonlinear unknowns.
    fitted : (R,)
        Part of the residual that it explains, in sigmas.
    """

    index: int
    log_evidence: float
    frequency: float
    trial: tuple[float, ...]
    fitted: Array

    @property
    def stable(self) -> bool:
        """Whether most halves call for it."""
        return self.frequency >= STABLE


def select_terms(
    problem: LinearProblem,
    library: Sequence[Candidate],
    poses: IntArray,
    rng: np.random.Generator,
    *,
    pairs: int = PAIRS,
) -> list[Selected]:
    """Select terms, in the order in which they were called for.

    Parameters
    ----------
    problem : LinearProblem
        The fit as it is.
    library : sequence of Candidate
        Terms; one may have several unknowns and trials.
    poses : (R,)
        Number of the pose of each component, from 0; -1 for readings that are in every half.
    rng : numpy Generator
        Draws the halves.
    """
    chosen, signatures = _forward(problem, library, rng)
    if not chosen:
        return []
    votes = np.zeros(len(chosen))
    count = int(poses.max()) + 1
    for _ in range(pairs):
        first = rng.permutation(count)[: count // 2]
        inside = np.isin(poses, first)
        for half in (inside | (poses < 0), ~inside):
            found, others = _forward(*_half(problem, library, half), rng)
            for number, signature in enumerate(signatures):
                votes[number] += any(
                    index == chosen[number][0] or _alike(problem, signature, other, half)
                    for (index, _, _), other in zip(found, others, strict=True)
                )
    return [
        Selected(index, evidence, float(vote) / (2 * pairs), trial, problem.project(signature))
        for (index, evidence, trial), vote, signature in zip(chosen, votes, signatures, strict=True)
    ]


def _half(
    problem: LinearProblem, library: Sequence[Candidate], half: BoolArray
) -> tuple[LinearProblem, list[Candidate]]:
    """The problem and the library on some of the components."""
    jacobian = problem.jacobian[:, half]
    slope = jacobian @ problem.residual[half] - problem.jacobian @ problem.residual
    live = None if problem.live is None else problem.live[half]
    empty = LinearProblem(problem.residual[half], jacobian, problem.prior_precision, live)
    residual = problem.residual[half] - empty.absorbed.T @ empty.whitened_step(slope)
    own = [replace(one, columns=np.ascontiguousarray(one.columns[:, :, half])) for one in library]
    return LinearProblem(residual, jacobian, problem.prior_precision, live), own


def _forward(
    problem: LinearProblem, library: Sequence[Candidate], rng: np.random.Generator
) -> tuple[list[tuple[int, float, tuple[float, ...]]], list[Array]]:
    """Forward selection: (term, evidence, trial) in order, and the terms' signatures (R,)."""
    scores = score(problem, library, rng, 0)
    found: list[tuple[int, float, tuple[float, ...]]] = []
    signatures: list[Array] = []
    while len(found) < MOST_TERMS:
        taken = {index for index, _, _ in found}
        left = [index for index in range(len(library)) if index not in taken]
        if not left:
            break
        best = max(left, key=lambda index: observed(scores, index)[0])
        evidence, parts = observed(scores, best)
        if evidence < ENOUGH:
            break
        trial = int(np.argmax(parts[0][:, 0]))
        signatures.append(_signature(scores, best, trial))
        found.append((best, evidence, library[best].trials[trial]))
        scores = scores.without(*joining(scores, best), rng)
    return found, signatures


def _signature(scores: Scores, index: int, trial: int) -> Array:
    beta, _ = scores.estimate(index, trial, scores.candidates[index].hypotheses[0])
    return np.asarray(beta @ scores.candidates[index].columns[trial])


def _alike(problem: LinearProblem, signature: Array, other: Array, half: BoolArray) -> bool:
    """Whether two signatures move the readings of a half alike once geometry has had its share."""
    padded = np.zeros(half.size)
    padded[half] = other
    one = problem.project(np.where(half, signature, 0.0))
    two = problem.project(padded)
    norm = float(np.linalg.norm(one) * np.linalg.norm(two))
    return norm > 0.0 and abs(float(one @ two)) > ALIKE * norm
