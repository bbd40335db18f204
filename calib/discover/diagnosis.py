"""Which effect is missing? All candidates and all structure judged in one family.

The candidates are scored against the residual of the current fit. Those that are significant are
added to the linearised fit one by one, the one with the most evidence first, until none is left;
what is significant then, and belongs to no candidate, is unexplained.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.discover.candidate import Candidate
from calib.discover.evidence import observed
from calib.discover.family import Family, family
from calib.discover.findings import Dependence, Diagnosis, Estimate, Finding, Unexplained
from calib.discover.pairs import rivals
from calib.discover.problem import LinearProblem
from calib.discover.quadratic import Quadratic
from calib.discover.scores import Scores, chi_squares, score

ALPHA = 0.05
DRAWS = 399
FIRST_DRAWS = 99
CLEAR = (0.1, 4.0)
"""Parts of alpha: p-values below and above are decided by the first draws, all others by all."""
STRUCTURE_SHARE = 0.05
"""Part of the false alarms that structure of unknown origin may cause; effects have the rest."""
IN_QUESTION = 7.0
"""Candidates whose evidence is less than e^7 below the best are still in question."""
UNKNOWN_MARGIN = 10.0
"""Structure of unknown origin must beat the effects' evidence by e^10 to be preferred,"""
UNKNOWN_SHARE = 0.1
"""and by this part of it: a scan meets no period exactly, at a cost that grows with the effect."""
MOST_EFFECTS = 6


@dataclass(frozen=True, eq=False)
class _Round:
    """One state of the linearised fit, judged."""

    scores: Scores
    family: Family
    effects: tuple[int, ...]

    def log_p(self, index: int) -> float:
        return self.family.log_p(float(self.family.strengths[index, 0]))

    def significant(self, alpha: float) -> list[int]:
        limit = np.log(alpha) + 1e-9
        return [index for index in self.effects if self.log_p(index) <= limit]


def diagnose(
    problem: LinearProblem,
    effects: Sequence[Candidate],
    structure: Sequence[Candidate] = (),
    quadratic: Sequence[Quadratic] = (),
    *,
    rng: np.random.Generator,
    draws: int = DRAWS,
    alpha: float = ALPHA,
) -> Diagnosis:
    """Judge all candidates and all structure as one family.

    Parameters
    ----------
    problem : LinearProblem
        The fit as it is.
    effects : sequence of Candidate
        Known effects that are not in the fit.
    structure : sequence of Candidate
        See :func:`calib.discover.structure.structure_candidates`.
    quadratic : sequence of Neighbours or Blocks
    rng : numpy Generator
        Draws the null distribution; the same seed gives the same answer.
    draws : int
        Null draws; 399 makes P(p <= 0.05) exactly 0.05.
    alpha : float
        Family-wise false alarm.
    """
    first_draws = min(FIRST_DRAWS, draws)
    scores = score(problem, [*effects, *structure], rng, first_draws)
    found = _explore(scores, len(effects), quadratic, alpha, rng)
    if draws > first_draws and found.close(alpha):
        scores = scores.with_more(draws - first_draws, rng)
        found = _explore(scores, len(effects), quadratic, alpha, rng)
    first, last, chosen = found.rounds[0], found.rounds[-1], found.chosen
    order, evidences = _ranked(first)
    findings = {index: _finding(first, index, evidences[index]) for index in order}
    left = _unexplained(last, quadratic, alpha)
    before = _unexplained(first, quadratic, alpha)
    unknown = max((d.log_evidence for d in before.dependences), default=0.0)
    explained = sum(value for _, value in chosen)
    preferred = unknown > (1.0 + UNKNOWN_SHARE) * max(explained, 0.0) + UNKNOWN_MARGIN
    if preferred and not left.significant:
        left = before
    return Diagnosis(
        findings=tuple(findings[index] for index in order),
        explained_by=tuple(scores.candidates[index].name for index, _ in chosen),
        indistinguishable=tuple(
            tuple(scores.candidates[index].name for index in group)
            for group in _groups(found, alpha)
        ),
        unexplained=left,
        unknown_preferred=preferred,
        adequate=not chosen and not left.significant,
        scatter=float(last.scores.squares[0]) / max(last.scores.problem.trace, 1.0),
        scores=scores,
        family=first.family,
    )


def _judge(scores: Scores, effects: int, quadratic: Sequence[Quadratic]) -> _Round:
    """Join effects, structure and quadratic tests to a family."""
    levels = [*scores.levels, *(test.level(scores.residuals) for test in quadratic)]
    weights = np.ones(len(levels))
    others = len(levels) - effects
    if effects and others:
        weights[effects:] = effects * STRUCTURE_SHARE / (1.0 - STRUCTURE_SHARE) / others
    return _Round(scores, family(levels, weights), tuple(range(effects)))


def _ranked(judged: _Round) -> tuple[list[int], dict[int, float]]:
    evidences = {i: observed(judged.scores, i)[0] for i in judged.effects}
    return sorted(judged.effects, key=lambda index: -evidences[index]), evidences


@dataclass(frozen=True, eq=False)
class _Explored:
    """Rounds of the linearised fit, and the effect with its evidence that ended each but the last.

    Effects are ``chosen`` one by one, the most evidence of the significant ones first.
    """

    rounds: tuple[_Round, ...]
    chosen: tuple[tuple[int, float], ...]

    def close(self, alpha: float) -> bool:
        """Whether any decision is so close that it takes more null draws."""
        decisive = [judged.log_p(index) for judged, (index, _) in self.pairs()]
        last = self.rounds[-1]
        decisive.append(last.log_p(int(np.argmax(last.family.strengths[:, 0]))))
        low, high = np.log(alpha) + np.log(CLEAR)
        return any(low < log_p < high for log_p in decisive)

    def pairs(self) -> list[tuple[_Round, tuple[int, float]]]:
        """Every round that chose, with what it chose."""
        return list(zip(self.rounds, self.chosen, strict=False))


def _explore(
    scores: Scores,
    effects: int,
    quadratic: Sequence[Quadratic],
    alpha: float,
    rng: np.random.Generator,
) -> _Explored:
    """Add significant effects to the linearised fit one by one."""
    rounds = [_judge(scores, effects, quadratic)]
    chosen: list[tuple[int, float]] = []
    while len(chosen) < MOST_EFFECTS:
        judged = rounds[-1]
        taken = {index for index, _ in chosen}
        significant = [index for index in judged.significant(alpha) if index not in taken]
        if not significant:
            break
        order, evidences = _ranked(judged)
        best = next(index for index in order if index in significant)
        chosen.append((best, evidences[best]))
        columns, precision = joining(judged.scores, best)
        rounds.append(_judge(judged.scores.without(columns, precision, rng), effects, quadratic))
    return _Explored(tuple(rounds), tuple(chosen))


def _groups(found: _Explored, alpha: float) -> list[tuple[int, ...]]:
    """For each chosen effect, itself first, those from which it cannot be told; none if alone."""
    groups: list[tuple[int, ...]] = []
    for judged, (best, _) in found.pairs():
        order, evidences = _ranked(judged)
        questioned = _in_question(judged, order, evidences, best, alpha)
        signatures = {i: _at_least(judged.scores, i) for i in questioned}
        if others := rivals(judged.scores, best, questioned, signatures):
            groups.append((best, *others))
    return groups


def _in_question(
    judged: _Round, order: list[int], evidences: dict[int, float], best: int, alpha: float
) -> list[int]:
    """The best, and those that are significant on their own and not yet refuted by the data."""
    own = judged.family.own_log_p
    return [
        index
        for index in order
        if index == best
        or (own[index] <= np.log(alpha) and evidences[index] > evidences[best] - IN_QUESTION)
    ]


def _best_hypothesis(scores: Scores, index: int) -> tuple[int, int]:
    """Number of the hypothesis and of the trial with the most evidence."""
    _, parts = observed(scores, index)
    number = int(np.argmax([part[:, 0].max() for part in parts]))
    return number, int(np.argmax(parts[number][:, 0]))


def _signature(scores: Scores, index: int) -> tuple[Array, int, int]:
    """Signature (R,) of a candidate's best hypothesis at its estimate; hypothesis and trial."""
    number, trial = _best_hypothesis(scores, index)
    candidate = scores.candidates[index]
    subset = candidate.hypotheses[number]
    beta, _ = scores.estimate(index, trial, subset)
    return beta @ candidate.columns[trial, list(subset)], number, trial


def _at_least(scores: Scores, index: int) -> Array:
    """Signature (R,) of the best hypothesis at the lower end of what its estimate leaves open.

    An effect that is significant is likelier over- than underestimated; one standard deviation of
    noise, and what noise alone would explain, are taken off its length.
    """
    signature, number, trial = _signature(scores, index)
    weighing = scores.weighings[index][number]
    fall = float(chi_squares(weighing, scores.scores[index][:, :, :1])[trial, 0]) / scores.noise**2
    beyond = np.sqrt(max(fall - float(weighing.dof[trial]), 0.0)) - 1.0
    return np.asarray(signature * (max(beyond, 0.0) / np.sqrt(max(fall, 1e-300))))


def joining(scores: Scores, index: int) -> tuple[Array, Array]:
    """Columns and prior precision with which a candidate joins the linearised fit.

    The whole group at its best trial and, along a scanned unknown, first and second differences
    of its signature between neighbouring trials: the refit would find the value between two.
    """
    candidate = scores.candidates[index]
    _, trial = _best_hypothesis(scores, index)
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


def _finding(judged: _Round, index: int, evidence: float) -> Finding:
    scores, candidate = judged.scores, judged.scores.candidates[index]
    signature, number, trial = _signature(scores, index)
    subset = candidate.hypotheses[number]
    weighing = scores.weighings[index][number]
    beta, covariance = scores.estimate(index, trial, candidate.hypotheses[0])
    sigmas = np.sqrt(np.diag(covariance))
    return Finding(
        index=index,
        name=candidate.name,
        log_p=judged.log_p(index),
        log_evidence=evidence,
        chi2_fall=float(chi_squares(weighing, scores.scores[index][:, :, :1])[trial, 0]),
        dof=int(weighing.dof[trial]),
        trial=candidate.trials[trial],
        acting=tuple(candidate.terms[term].name for term in subset),
        estimates=tuple(
            Estimate(term.name, float(value), float(sigma), term.unit)
            for term, value, sigma in zip(candidate.terms, beta, sigmas, strict=True)
        ),
        visible=scores.problem.visible(candidate.sizes[:, None] * candidate.columns[trial]),
        signature=signature,
    )


def _unexplained(judged: _Round, quadratic: Sequence[Quadratic], alpha: float) -> Unexplained:
    """Structure that is significant in a round, the channels with the most evidence first."""
    scores = judged.scores
    count = len(scores.candidates)
    found: dict[str, Dependence] = {}
    smallest = 0.0
    for index in range(len(judged.effects), count + len(quadratic)):
        log_p = judged.log_p(index)
        smallest = min(smallest, log_p)
        if log_p > np.log(alpha) + 1e-9:
            continue
        if index < count:
            here = _dependence(scores, index, log_p)
        else:
            here = Dependence(quadratic[index - count].channel, log_p, -log_p)
        known = found.get(here.channel)
        if known is None or here.log_evidence > known.log_evidence:
            found[here.channel] = here
    ordered = sorted(found.values(), key=lambda each: -each.log_evidence)
    return Unexplained(bool(ordered), smallest, tuple(ordered))


def _dependence(scores: Scores, index: int, log_p: float) -> Dependence:
    candidate = scores.candidates[index]
    evidence, parts = observed(scores, index)
    number, trial = _best_hypothesis(scores, index)
    period = None
    if candidate.trials[trial]:
        period = _peak([one[0] for one in candidate.trials], parts[number][:, 0], trial)
    return Dependence(candidate.channel, log_p, evidence, period)


def _peak(periods: list[float], evidence: Array, best: int) -> float:
    """Period at the top of a parabola through the best frequency tried and its neighbours."""
    if not 0 < best < len(periods) - 1:
        return periods[best]
    near = slice(best - 1, best + 2)
    frequency = 1.0 / np.array(periods[near])
    shift, height = frequency - frequency[1], evidence[near] - evidence[best]
    (left, right), (low, high) = shift[[0, 2]], height[[0, 2]]
    curvature = (high / right - low / left) / (right - left)
    if not curvature < 0.0:
        return periods[best]
    top = -0.5 * (high / right - curvature * right) / curvature
    return float(1.0 / (frequency[1] + np.clip(top, min(shift), max(shift))))
