"""Hold-out: how well the model predicts poses that it has not seen.

Five folds over whole poses, fixed when the run is loaded. Each fold's fit starts at the optimum of
all readings and takes the one Gauss-Newton step to the optimum without the fold; what that
neglects is of second order in a step of the size of the parameters' uncertainty.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, parts_of
from calib.identify.fitting import Fit, noise_variance
from calib.noise import Whitening
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
    linear = fit.linear
    pull = fit.prior_precision * fit.model.deviation(linear.state)
    return hold_out_of(fit, linear.whitened, linear.jacobian, fit.prior_precision, pull)


def hold_out_of(
    fit: Fit,
    whitened: Array,
    jacobian: Array,
    precision: Array,
    pull: Array,
    which: BoolArray | None = None,
) -> HoldOut:
    """Hold-out of any linearised model of a fit's readings, with the noise of the fit.

    Parameters
    ----------
    whitened, jacobian : (3, N), (p, 3, N)
        Residuals and derivatives in stated sigmas, near the optimum.
    precision, pull : (p,)
        1 / sigma^2 of the priors, and that times the distance from their means.
    which : (N,) bool, optional
        Readings, if not all that the fit has accepted.
    """
    rows = fit.model.rows
    accepted = fit.accepted if which is None else which
    learn = _independent if fit.whitening is None else _sharing
    squares, floor, count = 0.0, 0.0, 0
    teach = learn(fit, whitened, jacobian, precision, pull, accepted)
    for fold in np.unique(rows.fold[rows.fold >= 0]):
        held = (rows.fold == fold) & accepted
        told = held & rows.in_millimetres.any(axis=0)
        if not told.any() or held.sum() == accepted.sum():
            continue
        own = jacobian[:, :, held]
        try:
            inverse, slope = teach(held)
        except np.linalg.LinAlgError:
            continue  # the other poses alone leave something open: they predict nothing
        off = whitened[:, held] - np.tensordot(inverse @ slope, own, axes=1)
        squares += float(np.sum(rows.in_mm(off, held) ** 2))
        floor += noise_variance(fit, told)
        for part in parts_of(held):
            natural = rows.in_mm(jacobian[:, :, part], part).reshape(own.shape[0], -1)
            floor += float(np.sum(natural * (inverse @ natural)))
        count += int(told.sum())
    if count == 0:
        return HoldOut(float("nan"), float("nan"), 0)
    return HoldOut(float(np.sqrt(squares / count)), float(np.sqrt(floor / count)), count)


Teach = Callable[[BoolArray], tuple[Array, Array]]
"""Readings held out -> covariance (p, p) and slope (p,) of the fit to all others."""


def _independent(
    fit: Fit, whitened: Array, jacobian: Array, precision: Array, pull: Array, accepted: BoolArray
) -> Teach:
    """Readings that share no noise: the held-out ones' part is taken off the normal equations."""
    normal, slope = np.diag(precision), -pull
    for part in parts_of(accepted):
        chosen = jacobian[:, :, part].reshape(jacobian.shape[0], -1)
        normal = normal + chosen @ chosen.T
        slope = slope + chosen @ whitened[:, part].reshape(-1)

    def teach(held: BoolArray) -> tuple[Array, Array]:
        block = jacobian[:, :, held].reshape(jacobian.shape[0], -1)
        left = slope - block @ whitened[:, held].reshape(-1)
        return Scaled.of(normal - block @ block.T).inverse(), left

    return teach


def _sharing(
    fit: Fit, whitened: Array, jacobian: Array, precision: Array, pull: Array, accepted: BoolArray
) -> Teach:
    """Readings that share noise: those left are freed of theirs anew."""

    def teach(held: BoolArray) -> tuple[Array, Array]:
        left = accepted & ~held
        whitening = Whitening(fit.taking_of(left), fit.noise)
        chosen = whitening.apply(jacobian[:, :, left]).reshape(jacobian.shape[0], -1)
        residual = whitening.apply(whitened[:, left]).reshape(-1)
        return Scaled.of(normal_matrix(chosen, precision)).inverse(), chosen @ residual - pull

    return teach
