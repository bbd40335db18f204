"""Where does the model fail? Structure in the residual against every state variable, in order.

A picture of a dependence is an added-variable picture: the readings are binned by the variable,
and for all bins together the extension (or displacement) is estimated that the residual asks for,
b = (A M A^T + 1 / (2 size)^2)^-1 A e with A the response in each bin: what the fit could have
absorbed is accounted for, and the prior of twice the response's size stands for what it did absorb.
Their mean is taken off: a constant is nobody's dependence.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from calib.arrays import Array
from calib.evidence.diagnosis import DRAWS
from calib.evidence.family import ALPHA, family, p_of, significant
from calib.evidence.problem import LinearProblem
from calib.evidence.quadratic import Quadratic
from calib.evidence.rounds import signature_of
from calib.evidence.scores import Scores, score
from calib.evidence.structure import Response, Variable, structure_candidates

MOST_BINS = 8
Sharing = tuple[Callable[[Array], Array], LinearProblem]


@dataclass(frozen=True)
class Bin:
    """What the residual asks for where the variable is between ``low`` and ``high``."""

    low: float
    high: float
    readings: int
    value: float
    sigma: float


@dataclass(frozen=True, eq=False)
class Speaking:
    """How much of the residual depends on one state variable.

    Attributes
    ----------
    channel : str
    acts_on : str
        Response through which the dependence is strongest; ``axis`` its direction, from 0.
    unit : str
        Of the bins' values.
    p_value : float
        Family-wise over all variables that were looked at.
    significant : bool
    chi2_fall, dof : float, int
        By the hypothesis with the most evidence.
    fitted : (R,)
        Part of the residual that this hypothesis explains, in sigmas.
    period : float or None
        Where a periodic dependence is best; bins are then of the variable modulo the period.
    bins : tuple of Bin
        Added-variable picture in the direction that shows the most.
    """

    channel: str
    acts_on: str
    axis: int
    unit: str
    p_value: float
    significant: bool
    chi2_fall: float
    dof: int
    fitted: Array
    period: float | None
    bins: tuple[Bin, ...]


@dataclass(frozen=True)
class JointTest:
    """A test of structure that no single variable shows (neighbours in time, poses as a whole)."""

    channel: str
    p_value: float
    significant: bool


def compare_structure(
    problem: LinearProblem,
    variables: Sequence[Variable],
    quadratic: Sequence[Quadratic],
    *,
    components: int,
    rng: np.random.Generator,
    alpha: float = ALPHA,
    sharing: Sharing | None = None,
) -> tuple[list[Speaking], list[JointTest]]:
    """Look at the residual against every variable, the one with the most structure first.

    Parameters
    ----------
    problem : LinearProblem
        Components of a reading are ``R / components`` apart (axis after axis).
    variables : sequence of Variable
    quadratic : sequence of Neighbours or RigidBlocks
    components : int
        Components of a reading.
    rng : numpy Generator
        Draws the null distribution.
    sharing : (callable, LinearProblem), optional
        Where readings share noise: what makes columns (..., R) in stated sigmas white, as those of
        ``problem`` are, and the problem in stated sigmas.
    """
    named = [
        (variable, found) for variable in variables for found in structure_candidates([variable])
    ]
    free = _as_it_is if sharing is None else sharing[0]
    asked = [found if sharing is None else found.changed(free) for _, found in named]
    scores = score(problem, asked, rng, DRAWS)
    tests = [test.level(scores.residuals) for test in quadratic]
    levels = [*scores.levels, *tests]
    if not levels:
        return [], []
    joint = family(levels, np.ones(len(levels)))
    best: dict[str, int] = {}
    for index, (variable, _) in enumerate(named):
        known = best.get(variable.name)
        if known is None or joint.own_log_p[index] < joint.own_log_p[known]:
            best[variable.name] = index
    speaking = []
    for index in sorted(best.values(), key=lambda index: joint.own_log_p[index]):
        log_p = joint.log_p(float(joint.strengths[index, 0]))
        one = _speaking(scores, index, named[index][0], log_p, alpha, components, free)
        if sharing is not None:
            as_stated = signature_of(scores, index, named[index][1])[0]
            one = replace(one, fitted=sharing[1].project(as_stated))
        speaking.append(one)
    together = []
    for number, test in enumerate(quadratic):
        log_p = joint.log_p(float(joint.strengths[len(named) + number, 0]))
        together.append(JointTest(test.channel, p_of(log_p), significant(log_p, alpha)))
    return speaking, together


def _as_it_is(columns: Array) -> Array:
    return columns


def _speaking(
    scores: Scores,
    index: int,
    variable: Variable,
    log_p: float,
    alpha: float,
    components: int,
    free: Callable[[Array], Array],
) -> Speaking:
    """Describe the dependence behind one candidate."""
    candidate = scores.candidates[index]
    signature, number, trial = signature_of(scores, index)
    fall, dof = scores.fall(index, number, trial)
    acts_on = candidate.name.partition("(")[2].rstrip(")").partition(",")[0]
    response = next(each for each in variable.responses if each.name == acts_on)
    period = candidate.trials[trial][0] if candidate.trials[trial] else None
    shown = variable
    if period is not None:
        shown = replace(variable, values=np.mod(variable.values, period))
    pictures = [
        _binned(scores.problem, shown, response, axis, components, free)
        for axis in range(response.columns.shape[0])
    ]
    # Of a single bin nothing can differ: its sigma is zero.
    sizes = [sum((b.value / b.sigma) ** 2 for b in bins if b.sigma > 0.0) for bins in pictures]
    axis = int(np.argmax(sizes))
    return Speaking(
        channel=variable.name,
        acts_on=acts_on,
        axis=axis,
        unit=response.scale(axis)[0],
        p_value=p_of(log_p),
        significant=significant(log_p, alpha),
        chi2_fall=fall,
        dof=dof,
        fitted=scores.problem.project(signature),
        period=period,
        bins=pictures[axis],
    )


def _binned(
    problem: LinearProblem,
    variable: Variable,
    response: Response,
    axis: int,
    components: int,
    free: Callable[[Array], Array],
) -> tuple[Bin, ...]:
    """Estimates per bin of a variable along one direction of a response."""
    column = response.columns[axis]
    values = variable.values if variable.values.ndim == 1 else variable.values[axis]
    seen = column != 0.0
    if not seen.any():
        return ()
    edges = _edges(values[seen])
    inside = np.array([seen & (values >= low) & (values <= high) for low, high in edges])
    shapes = free(column * inside)
    size = response.scale(axis)[1]
    weight = shapes @ problem.project(shapes).T + np.eye(len(edges)) / (2.0 * size) ** 2
    covariance = np.linalg.inv(weight)
    centred = np.eye(len(edges)) - 1.0 / len(edges)
    estimate = centred @ covariance @ (shapes @ problem.residual)
    covariance = centred @ covariance @ centred
    readings = np.any(inside.reshape(len(edges), components, -1), axis=1).sum(axis=1)
    return tuple(
        Bin(float(low), float(high), int(count), float(value), float(np.sqrt(variance)))
        for (low, high), count, value, variance in zip(
            edges, readings, estimate, np.diag(covariance), strict=True
        )
    )


def _edges(values: Array) -> list[tuple[float, float]]:
    """Limits of bins with about equally many readings; one for each value if they are few."""
    distinct = np.unique(values)
    if distinct.size <= MOST_BINS:
        return [(value, value) for value in distinct]
    ranks = np.linspace(0, distinct.size, MOST_BINS + 1).astype(int)
    return [(distinct[first], distinct[last - 1]) for first, last in pairwise(ranks)]
