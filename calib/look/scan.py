"""What freeing columns would lower the cost of a fit by, the geometry freed with them.

With the whitened Jacobian J of a fit and its covariance C, columns A have the weight
V = A A^T - A J^T C J A^T and the scores s = A e; freeing them lowers chi-square and the cost of the
priors together by s^T V^-1 s. All moments are tried: sums over the readings from one on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.effects import effect_named
from calib.errors import BadInput
from calib.identify.fitting import Fit
from calib.identify.staged import fit_effects
from calib.identify.starting import aligned
from calib.mechanism.description import Machine
from calib.mechanism.rigid import rotate
from calib.model.prediction import Model
from calib.runs.record import Run
from calib.runs.stack import stack
from calib.scaled import Scaled, normal_matrix


def excess(fitted: Fit) -> float:
    """Chi-square and the cost of the priors, beyond what a good record leaves.

    A machine within its tolerances costs about as much as it has readings' components.
    """
    return fitted.chi2 + prior_cost(fitted) - 3.0 * float(fitted.accepted.sum())


def prior_cost(fitted: Fit) -> float:
    """How far the geometry was bent: the sum of squares in standard deviations of the priors."""
    return float(fitted.prior_precision @ fitted.model.deviation(fitted.linear.state) ** 2)


def with_the_excluded(fitted: Fit) -> Fit:
    """The fit as it would be of all readings, to first order: a step passes for so many strays."""
    accepted = fitted.model.usable.copy()
    precision = fitted.prior_precision
    jacobian, whitened = fitted.linear.jacobian, fitted.linear.whitened
    flat = jacobian[:, :, accepted].reshape(precision.size, -1)
    covariance = Scaled.of(normal_matrix(flat, precision)).inverse()
    slope = flat @ whitened[:, accepted].reshape(-1)
    slope -= precision * fitted.model.deviation(fitted.linear.state)
    step = covariance @ slope
    left = whitened - np.tensordot(step, jacobian, axes=1)
    here = fitted.linear.state
    there = replace(fitted.model.moved(here, step), near=here.near)
    return replace(
        fitted,
        linear=replace(fitted.linear, state=there, whitened=left),
        accepted=accepted,
        bad=(),
        step_covariance=covariance,
    )


def fit_of(machine: Machine, run: Run, known: Mapping[str, Array] | None = None) -> Fit | None:
    """Fit a run alone, with the effects that its record shows; None where that cannot be done."""
    return fit_together(machine, [run], known)


def fit_together(
    machine: Machine, runs: Sequence[Run], known: Mapping[str, Array] | None = None
) -> Fit | None:
    """The same of several runs, or parts of one, each with its own frame."""
    try:
        rows = replace(stack(machine, runs), known=known or {})
        return fit_effects(rows, [effect_named(name, machine) for name in rows.known])
    except (BadInput, np.linalg.LinAlgError):
        return None  # the fit that was asked for says it; parts may be too small for a frame


def from_nominal(machine: Machine, runs: Sequence[Run]) -> Fit | None:
    """The fit of all readings to first order from the nominal machine: nothing has bent it.

    Where a mistake is large, an optimum is bent by it, and has left out what it could not bend to.
    """
    try:
        model = Model(stack(machine, runs))
        _, linear = aligned(model, model.base_points(), np.ones(model.rows.count, dtype=bool))
    except BadInput:
        return None
    size = linear.jacobian.shape[0]
    begun = Fit(model, linear, model.usable, (), np.zeros((size, size)), 0, ())
    return with_the_excluded(begun)


AT_ONCE = 4000
"""Readings whose columns are multiplied with the Jacobian at once."""


@dataclass(frozen=True, eq=False)
class Scan:
    """Fall of chi-square (M,) if columns act from each accepted reading on, and their sizes."""

    fall: Array
    sizes: Array


def scan(fitted: Fit, columns: Array, *, early: bool = False) -> Scan:
    """Let columns (k, 3, A) act from reading m on (early: up to it), for every m of A accepted."""
    kept, k = np.flatnonzero(fitted.accepted), columns.shape[0]
    fall, sizes = np.empty(kept.size), np.empty((kept.size, k))
    unknowns = fitted.linear.jacobian.shape[0]
    sums = [np.zeros((k, k)), np.zeros(k), np.zeros((unknowns, k))]
    starts = range(0, kept.size, AT_ONCE)
    for start in starts if early else reversed(starts):
        part = slice(start, min(start + AT_ONCE, kept.size))
        own, here = columns[:, :, part], kept[part]
        ways = [
            np.einsum("kin,lin->nkl", own, own),
            np.einsum("kin,in->nk", own, fitted.linear.whitened[:, here]),
            np.einsum("pin,kin->npk", fitted.linear.jacobian[:, :, here], own),
        ]
        for way, before in zip(ways, sums, strict=True):
            _sum_up(way, before, early=early)
        sums = [way[-1 if early else 0].copy() for way in ways]
        weights, scores, mixed = ways
        weights -= np.einsum("npk,pq,nql->nkl", mixed, fitted.step_covariance, mixed, optimize=True)
        fall[part], sizes[part] = freed(weights, scores)
    return Scan(fall, sizes)


def freed(weights: Array, scores: Array) -> tuple[Array, Array]:
    """Fall s^T V^-1 s (n,) by columns of weights V (n, k, k) and scores s (n, k); sizes (n, k)."""
    own = np.einsum("nkk->nk", weights)
    least = np.maximum(1e-24 * own.max(axis=0, initial=0.0), 1e-300)  # of a column that is over
    size = np.sqrt(np.maximum(own, least))
    scaled = weights / size[:, :, None] / size[:, None, :] + 1e-6 * np.eye(size.shape[1])
    beta = np.linalg.solve(scaled, (scores / size)[:, :, None])[:, :, 0]
    return np.sum(beta * scores / size, axis=1), beta / size


def _sum_up(values: Array, before: Array, *, early: bool) -> None:
    """Make values (n, ...) the sums up to each (early) or from each on, and of those ``before``."""
    way = values if early else values[::-1]
    way[0] += before
    np.cumsum(way, axis=0, out=way)


def whitened(fitted: Fit, motions: Array) -> Array:
    """Motions (k, 3, N) in the base frame as whitened columns (k, 3, A)."""
    situation = fitted.linear.situation
    turned = np.stack([rotate(situation.frame_rotation, one) for one in motions])
    whitened = np.einsum("ijn,kjn->kin", situation.whitener, turned)
    return np.asarray(whitened[:, :, fitted.accepted])
