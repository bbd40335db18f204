"""What this run can tell: power to see an effect, and to tell one from another.

Both are answered by adding an effect of a given size to the null draws and repeating the very
decision that is made on the observation; nothing is assumed about the shape of its distribution.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.evidence.bayes import log_evidence, observed
from calib.evidence.family import Family
from calib.evidence.scores import Scores
from calib.evidence.tails import log_any, looks

TOLD_APART = 0.8
"""Pairs that the run would tell apart with a lower probability are reported."""
PAIR_DRAWS = 200


def shifted_scores(scores: Scores, index: int, signature: Array, draws: int) -> Array:
    """Scores (T, k, draws) of a candidate if ``signature`` (R,) were hidden in the null draws."""
    shift = scores.of_units(index, scores.problem.project(signature)[:, None])
    return np.asarray(scores.scores[index][:, :, 1 : 1 + draws] + shift)


def power(
    scores: Scores, family: Family, index: int, signature: Array, *, alpha: float = 0.05
) -> float:
    """Probability that a candidate is significant if ``signature`` (R,) is hidden.

    Family-wise at ``alpha``: its own scan and all other candidates are paid for.

    Parameters
    ----------
    signature : (R,)
        Whitened displacement of the readings by the effect at the size in question.
    """
    draws = family.highest.size
    projected = scores.problem.project(signature)
    shifted = shifted_scores(scores, index, signature, draws)
    along = scores.residuals.times(projected[None])[0, 1:]
    squares = scores.squares[1:] + 2.0 * along + projected @ projected
    level = scores.level(index, shifted, squares)
    null = scores.levels[index][1:]
    weight = family.strengths[index, 1:] + log_any(-null, looks(null))
    strength = weight[0] - log_any(-level, looks(null))
    return float(np.mean(strength > family.critical(alpha)))


def prefers(scores: Scores, truth: int, rival: int, signature: Array) -> float:
    """Probability that ``truth`` gets more evidence than ``rival`` if ``signature`` is hidden."""
    draws = min(PAIR_DRAWS, scores.squares.size - 1)
    signature = signature / scores.noise
    own, _ = log_evidence(scores, truth, shifted_scores(scores, truth, signature, draws))
    other, _ = log_evidence(scores, rival, shifted_scores(scores, rival, signature, draws))
    return float(np.mean(own > other + 1e-6) + 0.5 * np.mean(np.abs(own - other) <= 1e-6))


def rivals(
    scores: Scores, best: int, questioned: Sequence[int], signatures: dict[int, Array]
) -> list[int]:
    """Candidates among ``questioned`` from which this run cannot tell ``best``.

    The probability of telling a pair apart is the smaller of both directions: either may be the
    truth, with its signature in ``signatures[index]`` (R,). A pair is also undecided where the
    readings themselves have left it so, whatever was to be expected.
    """
    undecided = float(np.log(TOLD_APART / (1.0 - TOLD_APART)))
    mine, _ = observed(scores, best)
    found = []
    for rival in questioned:
        if rival == best:
            continue
        theirs, _ = observed(scores, rival)
        if (
            abs(mine - theirs) < undecided
            or prefers(scores, best, rival, signatures[best]) < TOLD_APART
            or prefers(scores, rival, best, signatures[rival]) < TOLD_APART
        ):
            found.append(rival)
    return found
