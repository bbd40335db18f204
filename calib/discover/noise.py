"""What is missing, judged against the noise that the readings themselves demand.

First the readings are taken as independent, as they state. Where that leaves something to be
explained, components of noise compete with it: they are estimated with every effect that was
called for in the fit, so that no effect passes for noise; then the same question is asked again
with that noise, and what was noise is no longer called for. Structure of unknown origin stands
against noise by its evidence: where it says more than noise would, noise is what is left beside it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.discover.diagnosis import RunDiagnosis, diagnose_fit
from calib.effects.component import Effect
from calib.evidence.findings import Joined
from calib.evidence.problem import LinearProblem
from calib.identify.fitting import Fit, with_noise
from calib.identify.readings import MASKED
from calib.identify.staged import fit_effects
from calib.noise import Found, estimate, points_to_scatter

CLEAR = float(np.log(1e-3))
"""log p of a test of structure, on its own, from which noise is asked for in an adequate model."""
SCATTER = 3.1
"""Standard deviations by which chi-square is off, from which the same holds."""
SEARCHED = 12.0
"""What likelihood counts less for structure: it is the best of thousands of periods and ways."""
TIED = 3.0
"""Log of the odds, 20 to 1, up to which the readings prefer neither noise nor an effect."""
ROUNDS = 3


def judge(fit: Fit, catalogue: Sequence[Effect], seed: int) -> RunDiagnosis:
    """Ask what is missing from a fit, against its noise.

    Parameters
    ----------
    fit : Fit
        Of independent readings.
    catalogue : sequence of Effect
    seed : int
        Of the null draws.
    """
    answer = _judged(fit, catalogue, seed)
    answer.diagnosis.rivals.told()  # while what it is made from is held
    return answer


def _judged(fit: Fit, catalogue: Sequence[Effect], seed: int) -> RunDiagnosis:
    white = diagnose_fit(fit, catalogue, np.random.default_rng(seed))
    if not _suspicious(white):
        return white
    problem, taking = fit.problem, fit.taking
    kept, found, tied = _beside(fit, catalogue, white.diagnosis.joined)
    structure = white.diagnosis.structure
    if structure is not None and structure.log_evidence > 0.0:
        smaller = _enlarged(problem, kept)
        larger = _enlarged(smaller, (structure,))
        beside = estimate(larger, taking)
        told = max(structure.log_evidence, _likelier(smaller, larger) - SEARCHED)
        if told + _worth(beside) > _worth(found):
            found = beside
    answer = white
    for _ in range(ROUNDS):
        if not found.components:
            return answer
        noisy = with_noise(fit, found.noise, found.components)
        answer.diagnosis.release()
        answer = diagnose_fit(noisy, catalogue, np.random.default_rng(seed))
        still = {one.name for one in answer.diagnosis.joined}
        left = tuple(one for one in kept if one.name in still)
        answer = replace(answer, noise_or=tuple(name for name in tied if name not in still))
        if len(left) == len(kept):
            break
        kept = left
        found = estimate(_enlarged(problem, kept), taking)
    return answer


def _beside(
    fit: Fit, catalogue: Sequence[Effect], joined: Sequence[Joined]
) -> tuple[tuple[Joined, ...], Found, list[str]]:
    """Those of the effects called for that say more than noise would, and the noise beside them.

    And the names of those that say as much as noise does.

    In the order of their evidence: one stays where the readings are likelier with it, and the noise
    that it leaves, than with the noise alone that they demand without it. Slow noise is so not
    taken for a drift, nor a drift for slow noise.
    """
    kept: tuple[Joined, ...] = ()
    problem, taking = fit.problem, fit.taking
    found, tied = estimate(problem, taking), []
    for one in joined:
        larger = _enlarged(problem, (one,))
        beside = estimate(larger, taking)
        told = max(one.log_evidence, _likelier(problem, larger)) + _worth(beside)
        if told <= _worth(found) < 2.0 * told and not kept:
            exact = _exact(fit, catalogue, one.name)
            if exact is not None:
                left = estimate(exact, taking)
                surely = _likelier(problem, exact) + _worth(left)
                if surely > told:
                    beside, told = left, surely
        if told > _worth(found):
            kept, found, problem = (*kept, one), beside, larger
        elif told > _worth(found) - TIED:
            tied.append(one.name)
    return kept, found, tied


def _exact(fit: Fit, catalogue: Sequence[Effect], name: str) -> LinearProblem | None:
    """A fit with the effect, if it has something searched that lies between two trials.

    Where a step is at a moment that was not tried, a few readings on its wrong side look like noise
    that wanders. None where other readings are strays then: the two cannot be compared.
    """
    rows = fit.model.rows
    effect = next(effect for effect in catalogue if effect.id == name)
    if not any(unknown.nonlinear for unknown in effect.unknowns(rows)):
        return None
    masked = [one.row for one in fit.bad if one.why == MASKED]
    larger = fit_effects(rows, (*fit.model.effects, effect), masked, fit)
    same = np.array_equal(larger.accepted, fit.accepted)
    return larger.problem if same else None


def _likelier(problem: LinearProblem, larger: LinearProblem) -> float:
    """Rise of the log likelihood by columns, less half the log of the readings for each.

    A floor of the evidence (Schwarz 1978) in the currency in which noise is counted: white noise as
    stated. Evidence allows for readings that scatter more, and so says less of a first effect
    where another is missing as well.
    """
    columns = larger.jacobian.shape[0] - problem.jacobian.shape[0]
    before, after = float(np.sum(problem.residual**2)), float(np.sum(larger.residual**2))
    price: float = columns * float(np.log(problem.residual.size))
    return 0.5 * (before - after - price)


def _worth(found: Found) -> float:
    """Log of what noise explains, less what the freedom of its components does by chance."""
    return found.gain - found.price


def _suspicious(white: RunDiagnosis) -> bool:
    fit = white.fit
    if not fit.dof > 0:
        return False
    off = abs(fit.chi2 - fit.dof) / np.sqrt(2.0 * fit.dof)
    alike = min(white.diagnosis.quadratic_log_p, default=0.0)
    if not white.diagnosis.adequate or off > SCATTER or alike < CLEAR:
        return True
    return math.log(max(points_to_scatter(fit.problem, fit.taking), 1e-300)) < CLEAR


def _enlarged(problem: LinearProblem, joined: Sequence[Joined]) -> LinearProblem:
    for one in joined:
        problem = problem.with_columns(one.columns, one.precision)
    return problem
