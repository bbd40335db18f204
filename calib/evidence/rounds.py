"""Rounds of the linearised fit: judge everything in one family, let the best effect join, again."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array
from calib.evidence.bayes import observed
from calib.evidence.candidate import Candidate
from calib.evidence.family import Family, family, significant
from calib.evidence.quadratic import Quadratic
from calib.evidence.scored import Scored
from calib.evidence.scores import Scores

STRUCTURE_SHARE = 0.05
"""Part of the false alarms that structure of unknown origin may cause; effects have the rest."""
CLEAR = (0.1, 4.0)
"""Parts of alpha: p-values below and above are decided by the first draws, all others by all."""
MOST_EFFECTS = 6


@dataclass(frozen=True, eq=False)
class Round:
    """One state of the linearised fit, judged; ``effects`` are the first of the candidates."""

    scores: Scores
    family: Family
    effects: tuple[int, ...]

    def log_p(self, index: int) -> float:
        """Log of the family-wise p-value of a candidate or of a quadratic test."""
        return self.family.log_p(float(self.family.strengths[index, 0]))

    def significant(self, alpha: float) -> list[int]:
        """Effects whose family-wise p-value is no larger than alpha."""
        return [index for index in self.effects if significant(self.log_p(index), alpha)]

    @cached_property
    def evidences(self) -> dict[int, float]:
        """Log Bayes factor of every effect, most first."""
        found = {index: observed(self.scores, index)[0] for index in self.effects}
        return dict(sorted(found.items(), key=lambda item: -item[1]))


@dataclass(frozen=True, eq=False)
class Exploration:
    """Rounds, and the effect with its evidence that ended each of them but the last."""

    rounds: tuple[Round, ...]
    chosen: tuple[tuple[int, float], ...]

    def close(self, alpha: float) -> bool:
        """Whether any decision is so close that it takes more null draws."""
        decisive = [judged.log_p(index) for judged, index in self.decided()]
        last, taken = self.rounds[-1], {index for index, _ in self.chosen}
        strengths = last.family.strengths[:, 0]
        effects = [index for index in last.effects if index not in taken]
        others = range(len(last.effects), strengths.size)
        strongest = [strengths[list(group)].max() for group in (effects, others) if group]
        decisive += [last.family.log_p(float(strength)) for strength in strongest]
        low, high = np.log(alpha) + np.log(CLEAR)
        return any(low < log_p < high for log_p in decisive)

    def decided(self) -> list[tuple[Round, int]]:
        """Every round that chose, with what it chose."""
        return [
            (judged, index) for judged, (index, _) in zip(self.rounds, self.chosen, strict=False)
        ]


def explore(
    scores: Scores,
    effects: int,
    quadratic: Sequence[Quadratic],
    alpha: float,
    rng: np.random.Generator,
) -> Exploration:
    """Let significant effects join the fit one by one, the one with the most evidence first.

    Parameters
    ----------
    scores : Scores
        Of candidates of which the first ``effects`` are known effects, the rest structure.
    quadratic : sequence of Neighbours or RigidBlocks
    alpha : float
        Family-wise false alarm of each round.
    rng : numpy Generator
    """
    rounds = [_judge(scores, effects, quadratic)]
    chosen: list[tuple[int, float]] = []
    while len(chosen) < MOST_EFFECTS:
        judged = rounds[-1]
        taken = {index for index, _ in chosen}
        significant = [index for index in judged.significant(alpha) if index not in taken]
        if not significant:
            break
        best = next(index for index in judged.evidences if index in significant)
        chosen.append((best, judged.evidences[best]))
        columns, precision = joining(judged.scores, best)
        larger = judged.scores.without(columns, precision, rng, best)
        rounds.append(_judge(larger, effects, quadratic))
    return Exploration(tuple(rounds), tuple(chosen))


def _judge(scores: Scores, effects: int, quadratic: Sequence[Quadratic]) -> Round:
    """Join effects, structure and quadratic tests to a family."""
    levels = [*scores.levels, *(test.level(scores.residuals) for test in quadratic)]
    weights = np.ones(len(levels))
    others = len(levels) - effects
    if effects and others:
        weights[effects:] = effects * STRUCTURE_SHARE / (1.0 - STRUCTURE_SHARE) / others
    return Round(scores, family(levels, weights), tuple(range(effects)))


def best_hypothesis(scores: Scored, index: int) -> tuple[int, int]:
    """Number of the hypothesis and of the trial with the most evidence."""
    _, parts = observed(scores, index)
    number = int(np.argmax([part[:, 0].max() for part in parts]))
    return number, int(np.argmax(parts[number][:, 0]))


def signature_of(
    scores: Scores, index: int, like: Candidate | None = None
) -> tuple[Array, int, int]:
    """Signature (R,) of a candidate's best hypothesis at its estimate; hypothesis and trial.

    ``like``: the same candidate with other columns, of which the signature is made.
    """
    number, trial = best_hypothesis(scores, index)
    candidate = like or scores.candidates[index]
    subset = candidate.hypotheses[number]
    beta, _ = scores.estimate(index, trial, subset)
    return beta @ candidate.columns[trial][list(subset)], number, trial


def at_least(scores: Scores, index: int) -> Array:
    """Signature (R,) of the best hypothesis at the lower end of what its estimate leaves open.

    An effect that is significant is likelier over- than underestimated; one standard deviation of
    noise, and what noise alone would explain, are taken off its length.
    """
    signature, number, trial = signature_of(scores, index)
    fall, dof = scores.fall(index, number, trial)
    fall /= scores.noise**2
    beyond = np.sqrt(max(fall - dof, 0.0)) - 1.0
    return np.asarray(signature * (max(beyond, 0.0) / np.sqrt(max(fall, 1e-300))))


def joining(scores: Scored, index: int) -> tuple[Array, Array]:
    """Columns and prior precision with which a candidate joins the linearised fit.

    The whole group at its best trial and, along a scanned unknown, first and second differences
    of its signature between neighbouring trials: the refit would find the value between two.
    """
    candidate = scores.candidates[index]
    _, trial = best_hypothesis(scores, index)
    columns = [*candidate.columns[trial]]
    precision = [*candidate.prior_precision]
    if len(candidate.trials) > 2 and len(candidate.trials[0]) == 1:
        middle = min(max(trial, 1), len(candidate.trials) - 2)
        beta, _ = scores.estimate(index, trial, candidate.hypotheses[0])
        low, here, high = (beta @ candidate.columns[middle + step] for step in (-1, 0, 1))
        for difference in (high - low, high + low - 2.0 * here):
            if float(difference @ difference) > 0.0:
                columns.append(difference)
                precision.append(1e-2)
    return np.array(columns), np.array(precision)
