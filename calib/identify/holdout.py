"""Hold-out: how well the model predicts poses that it has not seen.

Five folds over whole poses, fixed when the run is loaded. Each fold's fit starts at the optimum of
all readings and takes the one Gauss-Newton step to the optimum without the fold; what that
neglects is of second order in a step of the size of the parameters' uncertainty.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from calib.arrays import Array
from calib.identify.fitting import Fit


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
    rows, jacobian = fit.model.rows, fit.linear.jacobian
    normal = fit.jacobian @ fit.jacobian.T + np.diag(fit.prior_precision)
    slope = fit.jacobian @ fit.whitened - fit.prior_precision * fit.model.deviation(
        fit.linear.state
    )
    scale = 1.0 / np.sqrt(np.diag(normal))
    squares, floor, count = 0.0, 0.0, 0
    for fold in np.unique(rows.fold[rows.fold >= 0]):
        held = (rows.fold == fold) & fit.accepted
        if not held.any() or held.sum() == fit.accepted.sum():
            continue
        block = jacobian[:, :, held].reshape(jacobian.shape[0], -1)
        inverse = _inverse(normal - block @ block.T, scale)
        step = inverse @ (slope - block @ fit.linear.whitened[:, held].reshape(-1))
        own = _to_mm(rows.whitener[:, :, held], jacobian[:, :, held])
        residual = fit.linear.residual[:, held] - np.tensordot(step, own, axes=1)
        flat = own.reshape(own.shape[0], -1)
        squares += float(np.sum(residual**2))
        floor += float(np.einsum("iin->", rows.covariance[:, :, held]))
        floor += float(np.sum(flat * (inverse @ flat)))
        count += int(held.sum())
    if count == 0:
        return HoldOut(float("nan"), float("nan"), 0)
    return HoldOut(float(np.sqrt(squares / count)), float(np.sqrt(floor / count)), count)


def _inverse(normal: Array, scale: Array) -> Array:
    factor = linalg.cho_factor(normal * scale[:, None] * scale, lower=True)
    inverse: Array = linalg.cho_solve(factor, np.eye(scale.size))
    return inverse * scale[:, None] * scale


def _to_mm(whitener: Array, jacobian: Array) -> Array:
    factors = np.linalg.inv(np.moveaxis(whitener, -1, 0))
    answer: Array = np.einsum("nij,pjn->pin", factors, jacobian)
    return answer
