"""Hold-out: how well the model predicts poses that it has not seen.

Five folds over whole poses, fixed when the run is loaded. Each fold's fit starts at the optimum of
all readings and takes the one Gauss-Newton step to the optimum without the fold; what that
neglects is of second order in a step of the size of the parameters' uncertainty.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray
from calib.identify.fitting import Fit
from calib.runs.stack import Rows
from calib.scaled import Scaled, normal_matrix


@dataclass(frozen=True)
class HoldOut:
    """RMS over held-out readings, and what it would be for a perfect model, in mm."""

    rms_mm: float
    floor_mm: float
    readings: int


def hold_out(fit: Fit) -> HoldOut:
    """Predict every accepted platform reading from a fit that has not seen its pose.

    The floor is sqrt(mean tr(Sigma + J C J^T)) with C the covariance of the fold's fit. Answers
    nan if there are fewer than two poses.
    """
    pull = fit.prior_precision * fit.model.deviation(fit.linear.state)
    linear = fit.linear
    return hold_out_of(
        fit.model.rows, fit.accepted, linear.whitened, linear.jacobian, fit.prior_precision, pull
    )


def hold_out_of(
    rows: Rows,
    accepted: BoolArray,
    whitened: Array,
    jacobian: Array,
    precision: Array,
    pull: Array,
) -> HoldOut:
    """Hold-out of any linearised model of these readings.

    Parameters
    ----------
    whitened, jacobian : (3, N), (p, 3, N)
        Residuals and derivatives in sigmas, near the optimum.
    precision, pull : (p,)
        1 / sigma^2 of the priors, and that times the distance from their means.
    """
    chosen = jacobian[:, :, accepted].reshape(jacobian.shape[0], -1)
    normal = normal_matrix(chosen, precision)
    slope = chosen @ whitened[:, accepted].reshape(-1) - pull
    squares, floor, count = 0.0, 0.0, 0
    for fold in np.unique(rows.fold[rows.fold >= 0]):
        held = (rows.fold == fold) & accepted
        if not held.any() or held.sum() == accepted.sum():
            continue
        own = jacobian[:, :, held]
        block = own.reshape(own.shape[0], -1)
        inverse = Scaled.of(normal - block @ block.T).inverse()
        step = inverse @ (slope - block @ whitened[:, held].reshape(-1))
        off = whitened[:, held] - np.tensordot(step, own, axes=1)
        squares += float(np.sum(rows.in_mm(off, held) ** 2))
        floor += float(np.einsum("iin->", rows.covariance[:, :, held]))
        natural = rows.in_mm(own, held).reshape(own.shape[0], -1)
        floor += float(np.sum(natural * (inverse @ natural)))
        count += int(held.sum())
    if count == 0:
        return HoldOut(float("nan"), float("nan"), 0)
    return HoldOut(float(np.sqrt(squares / count)), float(np.sqrt(floor / count)), count)
