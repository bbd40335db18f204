"""Maximum likelihood over the readings: Gauss-Newton, damped where it is needed.

Minimised is chi2 + prior = sum |W_r (p_r - f_r(theta))|^2 + sum ((theta_i - c_i) / sigma_i)^2.
With the whitened Jacobian J (p, rows) and D = diag(1 / sigma^2) a step solves

    (J J^T + D) step = J e - D (theta - c),

scaled to a unit diagonal before the Cholesky factorisation: the priors keep it well conditioned,
and the frames, which have none, are seen by every reading.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.model.prediction import Model
from calib.model.state import Linearised
from calib.noise import Whitening
from calib.scaled import Scaled, normal_matrix

MAX_STEPS = 150
"""Steps after which the best point is the answer, settled or not."""
STRAIGHT = 12
"""Steps after which a valley is taken to be bent: steps are damped (Levenberg and Marquardt)."""
POOR, GOOD = 0.25, 0.75
"""Fall of the cost over the predicted one below which damping rises, above which it falls."""
LEAST_FALL = 1e-3
"""Fall of chi-square below which nothing is gained by a better step."""
ENOUGH = 0.8
"""Part of a step at which the cost is least, above which the whole step is taken."""
STALLED = 1e-4
"""Two steps that change chi-square by less than this times chi-square per freedom are the last.

Where a large effect is missing the residual bends the valley and steps zigzag in it for ever; a
hundredth of the uncertainty that such a misfit leaves is near enough.
"""
TOLERANCE = 1e-6
"""Steps end when the predicted fall of chi-square is below this, or below 1e-9 of it."""

AT_ONCE = 10_000
"""Readings whose derivatives are laid out at once."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where the fit ended: linearisation, covariance of a step (p, p), steps taken.

    ``settled`` is false where the cost still fell when the steps ran out, or no step was possible.
    """

    linear: Linearised
    covariance: Array
    steps: int
    settled: bool


def optimise(
    model: Model, linear: Linearised, accepted: BoolArray, whitening: Whitening | None = None
) -> Optimum:
    """Damped Gauss-Newton over the accepted readings (N,), freed of the noise that they share."""
    readings = _Readings(model, accepted, whitening)
    cost = readings.cost(linear)
    damping, stalled = 0.0, 0
    for taken in range(MAX_STEPS):
        normal, slope = readings.normal_equations(linear)
        while True:
            step = normal.solve(slope, damping)
            fall = float(step @ slope)
            if fall <= max(TOLERANCE, 1e-9 * cost) or stalled == 2:
                return Optimum(linear, normal.inverse(), taken, True)
            trial = _attempt(model, linear, step)
            if trial is not None:
                reached = readings.cost(trial)
                if taken < STRAIGHT:
                    tried = (trial, reached, cost - reached, fall)
                    trial, reached = _shortened(readings, linear, step, tried)
                if reached <= cost * (1.0 + 1e-12) or fall < LEAST_FALL:
                    break
            damping = max(10.0 * damping, 1e-4)
            if damping > 1e8:
                return Optimum(linear, normal.inverse(), taken, False)
        damping = _damped(damping, (cost - reached) / fall, bent=taken + 1 >= STRAIGHT)
        worth = cost / model.rows.components[accepted].sum()
        stalled = stalled + 1 if abs(cost - reached) < STALLED * worth else 0
        linear, cost = trial, reached
    normal, _ = readings.normal_equations(linear)
    return Optimum(linear, normal.inverse(), MAX_STEPS, False)


def _damped(damping: float, ratio: float, *, bent: bool) -> float:
    """Damping of the next step, by how much of the predicted fall (at most twice) has come."""
    if bent and ratio < POOR:
        return max(4.0 * damping, 1e-4)
    if bent and ratio < GOOD:
        return damping
    return 0.1 * damping if damping > 1e-6 else 0.0


def _shortened(
    readings: "_Readings",
    linear: Linearised,
    step: Array,
    tried: tuple[Linearised, float, float, float],
) -> tuple[Linearised, float]:
    """Take less of a step that overshoots: a period may zigzag about its optimum for ever.

    Along the step the cost is c - 2 F t + a t^2 with F the predicted fall; a follows from the cost
    at t = 1, and the minimum is at F / a.
    """
    trial, reached, fallen, fall = tried
    best = fall / max(2.0 * fall - fallen, 1e-300)
    if best > ENOUGH or fall < LEAST_FALL:
        return trial, reached
    shorter = _attempt(readings.model, linear, best * step)
    if shorter is None:
        return trial, reached
    cost = readings.cost(shorter)
    return (shorter, cost) if cost < reached else (trial, reached)


def _attempt(model: Model, linear: Linearised, step: Array) -> Linearised | None:
    try:
        return model.linearise(model.moved(linear.state, step))
    except BadInput:  # the machine does not close there: a shorter step will
        return None


@dataclass(frozen=True, eq=False)
class _Readings:
    """The accepted readings of a model, and what frees them of noise that they share."""

    model: Model
    accepted: BoolArray
    whitening: Whitening | None

    @cached_property
    def precision(self) -> Array:
        return np.asarray(1.0 / self.model.prior**2)

    def white(self, columns: Array) -> Array:
        """(..., 3, N) -> (..., 3 A)."""
        chosen = columns if self.accepted.all() else columns[..., self.accepted]
        if self.whitening is not None:
            chosen = self.whitening.apply(chosen)
        return chosen.reshape(*columns.shape[:-2], -1)

    def cost(self, linear: Linearised) -> float:
        """Squared residuals, made white, and the priors' part."""
        prior = self.precision * self.model.deviation(linear.state) ** 2
        return float(np.sum(self.white(linear.whitened) ** 2) + np.sum(prior))

    def normal_equations(self, linear: Linearised) -> tuple[Scaled, Array]:
        """Normal matrix and slope (p,), of a part of the readings at a time where they are many."""
        pull = self.precision * self.model.deviation(linear.state)
        if self.whitening is not None or self.accepted.size <= AT_ONCE:
            flat = self.white(linear.jacobian)
            slope = flat @ self.white(linear.whitened) - pull
            return Scaled.of(normal_matrix(flat, self.precision)), slope
        normal, slope = np.diag(self.precision), -pull
        kept = np.flatnonzero(self.accepted)
        for first in range(0, kept.size, AT_ONCE):
            part = kept[first : first + AT_ONCE]
            flat = linear.jacobian[:, :, part].reshape(pull.size, -1)
            normal += flat @ flat.T
            slope += flat @ linear.whitened[:, part].reshape(-1)
        return Scaled.of(normal), slope
