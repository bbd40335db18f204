"""Which effect is missing? All candidates and all structure judged in one family.

The candidates are scored against the residual of the current fit. Those that are significant are
added to the linearised fit one by one, the one with the most evidence first, until none is left;
what is significant then, and belongs to no candidate, is unexplained.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.evidence.bayes import observed
from calib.evidence.candidate import Candidate
from calib.evidence.family import ALPHA, significant
from calib.evidence.findings import (
    Dependence,
    Diagnosis,
    Finding,
    Groups,
    Joined,
    Rivals,
    Unexplained,
)
from calib.evidence.pairs import rivals
from calib.evidence.problem import LinearProblem
from calib.evidence.quadratic import Quadratic
from calib.evidence.rounds import (
    Exploration,
    Round,
    at_least,
    best_hypothesis,
    explore,
    joining,
    signature_of,
)
from calib.evidence.scores import Scores, score
from calib.evidence.tails import log_tail
from calib.unknown import estimates_of

DRAWS = 399
FIRST_DRAWS = 99
IN_QUESTION = 7.0
"""Candidates whose evidence is less than e^7 below the best are still in question."""
CLEAR, SAME = 1e-3, 1e-6
"""p-value below which an addition is no chance; part of a signature that is rounding."""
JOINED = 3
"""Kinds of structure that compete for what is taken beside noise, those with the most evidence."""
UNKNOWN_MARGIN = 10.0
"""Structure of unknown origin must beat the effects' evidence by e^10 to be preferred,"""
UNKNOWN_SHARE = 0.1
"""and by this part of it: a scan meets no period exactly, at a cost that grows with the effect."""


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
        See :func:`calib.evidence.structure.structure_candidates`.
    quadratic : sequence of Neighbours or RigidBlocks
    rng : numpy Generator
        Draws the null distribution; the same seed gives the same answer.
    draws : int
        Null draws where a decision is close; the first 99 decide what is clear. With 399 ranked
        among them, P(p <= 0.05) is 0.05.
    alpha : float
        Family-wise false alarm.
    """
    first_draws = min(FIRST_DRAWS, draws)
    scores = score(problem, [*effects, *structure], rng, first_draws)
    found = explore(scores, len(effects), quadratic, alpha, rng)
    if draws > first_draws and found.close(alpha):
        scores = scores.with_more(draws - first_draws, rng)
        found = explore(scores, len(effects), quadratic, alpha, rng)
    first, last, chosen = found.rounds[0], found.rounds[-1], found.chosen
    left = _unexplained(last, quadratic, alpha)
    before = _unexplained(first, quadratic, alpha)
    unknown = max((d.log_evidence for d in before.dependences), default=0.0)
    explained = sum(value for _, value in chosen)
    preferred = unknown > (1.0 + UNKNOWN_SHARE) * max(explained, 0.0) + UNKNOWN_MARGIN
    if preferred and not left.significant:
        left = before
    return Diagnosis(
        findings=tuple(_finding(first, index, value) for index, value in first.evidences.items()),
        explained_by=tuple(scores.candidates[index].name for index, _ in chosen),
        rivals=Rivals(lambda: _groups(found, alpha)),
        unexplained=left,
        unknown_preferred=preferred,
        adequate=not chosen and not left.significant,
        scatter=float(last.scores.squares[0]) / max(last.scores.problem.trace, 1.0),
        scores=scores,
        family=first.family,
        joined=tuple(
            Joined(scores.candidates[index].name, evidence, *joining(judged.scores, index))
            for judged, (index, evidence) in zip(found.rounds, chosen, strict=False)
        ),
        structure=_structure(last, alpha),
        quadratic_log_p=tuple(map(float, first.family.own_log_p[len(scores.candidates) :])),
    )


def _structure(judged: Round, alpha: float) -> Joined | None:
    """Significant structure, as columns: of those with the most evidence the likeliest."""
    scores = judged.scores
    others = range(len(judged.effects), len(scores.candidates))
    called = [index for index in others if significant(judged.log_p(index), alpha)]
    if not called:
        return None
    called.sort(key=lambda index: -observed(scores, index)[0])
    offered = [
        Joined(scores.candidates[index].name, observed(scores, index)[0], *_joining(scores, index))
        for index in called[:JOINED]
    ]
    price = float(np.log(scores.problem.residual.size))

    def likelier(one: Joined) -> float:
        fall = _estimate(scores, one.columns, one.precision)[1]
        return fall - price * float(one.columns.shape[0])

    return max(offered, key=likelier)


def _joining(scores: Scores, index: int) -> tuple[Array, Array]:
    """Columns and prior precision with which structure joins: a period that no trial quite is.

    Trials are half an independent frequency apart: too far for what is slow and strong.
    """
    candidate = scores.candidates[index]
    _, trial = best_hypothesis(scores, index)
    if candidate.between is None or not candidate.trials[trial]:
        return joining(scores, index)
    period = _refined(scores, index, trial)
    columns, precision = candidate.between(period), candidate.prior_precision
    beta, _ = _estimate(scores, columns, precision)
    low, high = (beta @ candidate.between(factor * period) for factor in (0.99, 1.01))
    return np.vstack([columns, high - low]), np.append(precision, 1e-2)


def _groups(found: Exploration, alpha: float) -> Groups:
    """For each chosen effect, itself first, those from which it cannot be told; none if alone."""
    groups: list[tuple[int, ...]] = []
    for judged, best in found.decided():
        questioned = _in_question(judged, best, alpha)
        signatures = {index: at_least(judged.scores, index) for index in questioned}
        others = rivals(judged.scores, best, questioned, signatures)
        others += [one for one in _as_good(judged, best, alpha) if one not in others]
        others = [one for one in others if not _only_wider(judged.scores, best, one)]
        if others:
            groups.append((best, *others))
    candidates = found.rounds[0].scores.candidates
    return tuple(tuple(candidates[index].name for index in group) for group in groups)


def _only_wider(scores: Scores, best: int, rival: int) -> bool:
    """Whether a rival holds the best as a special case, and what it adds may be chance.

    One expansion of all legs is the case of six that are equal: six are no rival of it as long as
    these readings do not ask for six, however little their evidence differs.
    """
    _, trial = best_hypothesis(scores, best)
    number, other = best_hypothesis(scores, rival)
    part, whole = scores.candidates[best].columns[trial], scores.candidates[rival].columns[other]
    if len(whole) <= len(part):
        return False
    left = part - np.linalg.lstsq(whole.T, part.T, rcond=None)[0].T @ whole
    if np.linalg.norm(left) > SAME * np.linalg.norm(part):
        return False
    mine, dof = scores.fall(best, *best_hypothesis(scores, best))
    theirs, of_whole = scores.fall(rival, number, other)
    more = np.array(max(theirs - mine, 0.0) / scores.noise**2)
    return bool(log_tail(more, float(of_whole - dof)) > np.log(CLEAR)) if of_whole > dof else True


def _as_good(judged: Round, best: int, alpha: float) -> list[int]:
    """Candidates that explain as much as the best, each unknown charged with two of chi-square.

    What sizes were thought usual does not count here: they may be wrong by more than e^7.
    """

    def worth(index: int) -> float:
        fall, dof = judged.scores.fall(index, *best_hypothesis(judged.scores, index))
        return fall - 2.0 * dof

    reached, own = worth(best), judged.family.own_log_p
    return [
        index
        for index in judged.evidences
        if index != best and own[index] <= np.log(alpha) and worth(index) >= reached
    ]


def _in_question(judged: Round, best: int, alpha: float) -> list[int]:
    """The best, and those that are significant on their own and not yet refuted by the data."""
    own, evidences = judged.family.own_log_p, judged.evidences
    return [
        index
        for index in evidences
        if index == best
        or (own[index] <= np.log(alpha) and evidences[index] > evidences[best] - IN_QUESTION)
    ]


def _finding(judged: Round, index: int, evidence: float) -> Finding:
    scores, candidate = judged.scores, judged.scores.candidates[index]
    signature, number, trial = signature_of(scores, index)
    fall, dof = scores.fall(index, number, trial)
    beta, covariance = scores.estimate(index, trial, candidate.hypotheses[0])
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Finding(
        index=index,
        name=candidate.name,
        log_p=judged.log_p(index),
        log_evidence=evidence,
        chi2_fall=fall,
        dof=dof,
        trial=candidate.trials[trial],
        acting=tuple(candidate.unknowns[index].name for index in candidate.hypotheses[number]),
        estimates=estimates_of(candidate.unknowns, beta, sigmas),
        visible=scores.problem.visible(candidate.sizes[:, None] * candidate.columns[trial]),
        signature=signature,
    )


def _unexplained(judged: Round, quadratic: Sequence[Quadratic], alpha: float) -> Unexplained:
    """Structure that is significant in a round, the channels with the most evidence first."""
    scores = judged.scores
    count = len(scores.candidates)
    found: dict[str, Dependence] = {}
    smallest = 0.0
    for index in range(len(judged.effects), count + len(quadratic)):
        log_p = judged.log_p(index)
        smallest = min(smallest, log_p)
        if not significant(log_p, alpha):
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
    evidence, _ = observed(scores, index)
    number, trial = best_hypothesis(scores, index)
    subset, period = list(candidate.hypotheses[number]), None
    columns, precision = candidate.columns[trial], candidate.prior_precision
    if candidate.trials[trial] and candidate.between is not None:
        period = _refined(scores, index, trial)
        columns = candidate.between(period)
    beta, _ = _estimate(scores, columns[subset], precision[subset])
    return Dependence(
        candidate.channel,
        log_p,
        evidence,
        period,
        carrier=candidate.name.partition("(")[2].rstrip(")").partition(",")[0],
        acting=tuple(candidate.unknowns[k].name for k in subset),
        estimates=tuple(map(float, beta)),
        unit=candidate.unknowns[subset[0]].unit,
    )


def _refined(scores: Scores, index: int, trial: int) -> float:
    """Period between the trials about the best, where chi-square falls most."""
    candidate = scores.candidates[index]
    assert candidate.between is not None
    between, precision = candidate.between, candidate.prior_precision
    frequencies = np.sort([1.0 / one[0] for one in candidate.trials])
    at = int(np.searchsorted(frequencies, 1.0 / candidate.trials[trial][0] * (1.0 - 1e-9)))
    low, high = frequencies[max(at - 1, 0)], frequencies[min(at + 1, frequencies.size - 1)]

    def rise(frequency: float) -> float:
        return -_estimate(scores, between(1.0 / frequency), precision)[1]

    grid = np.linspace(low, high, 9)
    best = int(np.argmin([rise(one) for one in grid]))
    inside = (grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)])
    from scipy import optimize  # a third of the time that a verb takes to start

    found = optimize.minimize_scalar(rise, bounds=inside, method="bounded")
    return float(1.0 / found.x)


def _estimate(scores: Scores, columns: Array, precision: Array) -> tuple[Array, float]:
    """Amplitudes (k,) of columns (k, R) in the observation, and the fall of the cost by them."""
    weight = columns @ scores.problem.project(columns).T + np.diag(precision)
    slope = columns @ scores.problem.residual
    beta = np.linalg.lstsq(weight, slope, rcond=1e-12)[0]
    return np.asarray(beta), float(beta @ slope)
