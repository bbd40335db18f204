"""Propose terms for what no known effect explains: sparse, and stable under resampling.

A library of small formulas is offered. The one with the most evidence joins the fit, the residual
is looked at again, and so on until none adds more than e^3 (sparse regression by forward
selection; the evidence pays for a formula's number of unknowns and of trials). The selection is
repeated on complementary halves of the poses (Shah and Samworth 2013): a term is stable if it, or
one that the readings cannot tell from it, is selected in most halves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.evidence.bayes import observed
from calib.evidence.candidate import Candidate
from calib.evidence.halves import Half, all_joined, halves_of
from calib.evidence.problem import LinearProblem
from calib.evidence.rounds import joining
from calib.evidence.scored import Scored
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
    scores = score(problem, library, rng, 0)
    library = scores.candidates
    chosen, signatures = _forward(scores, rng)
    if not chosen:
        return []
    count = int(poses.max()) + 1
    firsts = [np.isin(poses, rng.permutation(count)[: count // 2]) for _ in range(pairs)]
    votes = np.zeros(len(chosen))
    for half, found, others in _forward_each(halves_of(problem, library, poses < 0, firsts)):
        for number, signature in enumerate(signatures):
            votes[number] += any(
                index == chosen[number][0] or _alike(problem, signature, other, half)
                for (index, _, _), other in zip(found, others, strict=True)
            )
    return [
        Selected(index, evidence, float(vote) / (2 * pairs), trial, problem.project(signature))
        for (index, evidence, trial), vote, signature in zip(chosen, votes, signatures, strict=True)
    ]


Found = list[tuple[int, float, tuple[float, ...]]]
"""Terms, evidence, trials, in the order in which they were called for."""


def _forward(scores: Scores, rng: np.random.Generator) -> tuple[Found, list[Array]]:
    """Forward selection over all readings: terms, and their signatures (R,)."""
    found: Found = []
    signatures: list[Array] = []
    while (best := _next(scores, found)) is not None:
        signatures.append(_signature(scores, best))
        if len(found) < MOST_TERMS:
            scores = scores.without(*joining(scores, best), rng)
    return found, signatures


def _forward_each(halves: Sequence[Half]) -> list[tuple[BoolArray, Found, list[Array]]]:
    """The same on every half, all in step; components that are in, terms, signatures (R,)."""
    answers: list[tuple[BoolArray, Found, list[Array]]] = [(one.inside, [], []) for one in halves]
    going = list(enumerate(halves))
    for _ in range(MOST_TERMS):
        chosen = [
            (number, half, best)
            for number, half in going
            if (best := _next(half, answers[number][1])) is not None
        ]
        for number, half, best in chosen:
            answers[number][2].append(_signature(half, best) * half.inside)
        last = all(len(answers[number][1]) == MOST_TERMS for number, _, _ in chosen)
        if not chosen or last:
            break
        enlarged = all_joined(
            [half for _, half, _ in chosen], [joining(half, best) for _, half, best in chosen]
        )
        going = [(number, half) for (number, _, _), half in zip(chosen, enlarged, strict=True)]
    return answers


def _next(scores: Scored, found: Found) -> int | None:
    """Term with the most evidence, put down behind those ``found``; None where none adds enough."""
    taken = {index for index, _, _ in found}
    left = [index for index in range(len(scores.candidates)) if index not in taken]
    if not left or len(found) == MOST_TERMS:
        return None
    best = max(left, key=lambda index: observed(scores, index)[0])
    evidence, parts = observed(scores, best)
    if evidence < ENOUGH:
        return None
    found.append((best, evidence, scores.candidates[best].trials[int(np.argmax(parts[0][:, 0]))]))
    return best


def _signature(scores: Scored, index: int) -> Array:
    """Signature (R,) of a whole term at its best trial and estimate."""
    trial = int(np.argmax(observed(scores, index)[1][0][:, 0]))
    candidate = scores.candidates[index]
    beta, _ = scores.estimate(index, trial, candidate.hypotheses[0])
    return np.asarray(beta @ candidate.columns[trial])


def _alike(problem: LinearProblem, signature: Array, other: Array, half: BoolArray) -> bool:
    """Whether two signatures move the readings of a half alike once geometry has had its share."""
    one = problem.project(np.where(half, signature, 0.0))
    two = problem.project(other)
    norm = float(np.linalg.norm(one) * np.linalg.norm(two))
    return norm > 0.0 and abs(float(one @ two)) > ALIKE * norm
