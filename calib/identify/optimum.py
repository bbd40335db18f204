"""Maximum likelihood over the readings: Gauss-Newton, damped where it is needed.

Minimised is chi2 + prior = sum |W_r (p_r - f_r(theta))|^2 + sum ((theta_i - c_i) / sigma_i)^2.
With the whitened Jacobian J (p, rows) and D = diag(1 / sigma^2) a step solves

    (J J^T + D) step = J e - D (theta - c),

scaled to a unit diagonal before the Cholesky factorisation: the priors keep it well conditioned,
and the frames, which have none, are seen by every reading.
"""

import numpy as np

from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.model.prediction import Model
from calib.model.state import Linearised
from calib.scaled import Scaled, normal_matrix

MAX_STEPS = 30
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


def optimise(
    model: Model, linear: Linearised, accepted: BoolArray
) -> tuple[Linearised, Array, int]:
    """Damped Gauss-Newton; returns the optimum, the covariance of the unknowns and the steps."""
    precision = 1.0 / model.prior**2
    cost = _cost(model, linear, accepted, precision)
    damping, stalled = 0.0, 0
    for taken in range(1, MAX_STEPS + 1):
        normal, slope = _normal_equations(model, linear, accepted, precision)
        while True:
            step = normal.solve(slope, damping)
            fall = float(step @ slope)
            if fall <= max(TOLERANCE, 1e-9 * cost) or stalled == 2:
                return linear, normal.inverse(), taken - 1
            trial = _attempt(model, linear, step)
            if trial is not None:
                reached = _cost(model, trial, accepted, precision)
                trial, reached = _shortened(
                    model, linear, step, (trial, reached, cost - reached, fall), accepted, precision
                )
                if reached <= cost * (1.0 + 1e-12) or fall < LEAST_FALL:
                    break
            damping = max(10.0 * damping, 1e-4)
            if damping > 1e8:
                raise BadInput(
                    "the fit does not converge",
                    remedy="Check that the run belongs to this machine; see its residuals",
                )
        damping *= 0.1 if damping > 1e-6 else 0.0
        worth = cost / (3.0 * accepted.sum())
        stalled = stalled + 1 if abs(cost - reached) < STALLED * worth else 0
        linear, cost = trial, reached
    raise BadInput(
        f"the fit has not converged in {MAX_STEPS} steps",
        remedy="Check that the run belongs to this machine; see its residuals",
    )


def _shortened(
    model: Model,
    linear: Linearised,
    step: Array,
    tried: tuple[Linearised, float, float, float],
    accepted: BoolArray,
    precision: Array,
) -> tuple[Linearised, float]:
    """Take less of a step that overshoots: a period may zigzag about its optimum for ever.

    Along the step the cost is c - 2 F t + a t^2 with F the predicted fall; a follows from the cost
    at t = 1, and the minimum is at F / a.
    """
    trial, reached, fallen, fall = tried
    best = fall / max(2.0 * fall - fallen, 1e-300)
    if best > ENOUGH or fall < LEAST_FALL:
        return trial, reached
    shorter = _attempt(model, linear, best * step)
    if shorter is None:
        return trial, reached
    cost = _cost(model, shorter, accepted, precision)
    return (shorter, cost) if cost < reached else (trial, reached)


def _attempt(model: Model, linear: Linearised, step: Array) -> Linearised | None:
    try:
        return model.linearise(model.moved(linear.state, step))
    except BadInput:  # the machine does not close there: a shorter step will
        return None


def _cost(model: Model, linear: Linearised, accepted: BoolArray, precision: Array) -> float:
    residual = linear.whitened[:, accepted]
    return float(np.sum(residual**2) + np.sum(precision * model.deviation(linear.state) ** 2))


def _normal_equations(
    model: Model, linear: Linearised, accepted: BoolArray, precision: Array
) -> tuple[Scaled, Array]:
    """Normal matrix and slope (p,)."""
    jacobian = linear.jacobian
    if not accepted.all():
        jacobian = jacobian[:, :, accepted]
    flat = jacobian.reshape(jacobian.shape[0], -1)
    slope = flat @ linear.whitened[:, accepted].reshape(-1)
    slope -= precision * model.deviation(linear.state)
    return Scaled.of(normal_matrix(flat, precision)), slope
