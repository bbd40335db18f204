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
from calib.noise import Whitening, drawn
from calib.scaled import Scaled, normal_matrix

DRAWS = 32
"""Draws of the noise that readings share, of which the floor is the mean: to some per cent."""
SEED = 20_260_803


@dataclass(frozen=True)
class HoldOut:
    """RMS over held-out readings, and what it would be for a perfect model, in mm."""

    rms_mm: float
    floor_mm: float
    readings: int


def hold_out(fit: Fit) -> HoldOut:
    """Predict every accepted platform reading from a fit that has not seen its pose.

    The floor is sqrt(mean tr(Sigma + J C J^T)) with C the covariance of the fold's fit; where
    readings share noise, and so what is held out with what is not, the mean over draws of that
    noise, predicted in the same way. Answers nan if there are fewer than two poses.
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
    *,
    floor: bool = True,
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
    floor : bool
        Whether the floor is asked for; else it is nan.
    """
    rows = fit.model.rows
    accepted = fit.accepted if which is None else which
    observed, pulls = whitened[None], pull[None]
    shared = floor and (fit.noise.tau_s > 0.0 or fit.noise.visit > 0.0)
    if shared:
        noise, priors = _as_noise(fit, accepted, precision)
        observed, pulls = np.concatenate([observed, noise]), np.concatenate([pulls, priors])
    learn = _independent if fit.whitening is None else _sharing
    squares, expected, count = 0.0, 0.0, 0
    teach = learn(fit, observed, jacobian, precision, pulls, accepted)
    for fold in np.unique(rows.fold[rows.fold >= 0]):
        held = (rows.fold == fold) & accepted
        told = held & rows.in_millimetres.any(axis=0)
        if not told.any() or held.sum() == accepted.sum():
            continue
        own = jacobian[:, :, held]
        try:
            inverse, slopes = teach(held)
        except np.linalg.LinAlgError:
            continue  # the other poses alone leave something open: they predict nothing
        off = observed[:, :, held] - np.tensordot(slopes @ inverse, own, axes=1)
        off = np.sum(rows.in_mm(off, held) ** 2, axis=(1, 2))
        squares += float(off[0])
        if not floor:
            expected = float("nan")
        elif shared:
            expected += float(off[1:].mean())
        else:
            expected += noise_variance(fit, told)
            for part in parts_of(held):
                natural = rows.in_mm(jacobian[:, :, part], part).reshape(own.shape[0], -1)
                expected += float(np.sum(natural * (inverse @ natural)))
        count += int(told.sum())
    if count == 0:
        return HoldOut(float("nan"), float("nan"), 0)
    return HoldOut(float(np.sqrt(squares / count)), float(np.sqrt(expected / count)), count)


def _as_noise(fit: Fit, accepted: BoolArray, precision: Array) -> tuple[Array, Array]:
    """Readings (D, 3, N) that are noise alone, and pulls (D, p) of a machine of the priors."""
    rng = np.random.default_rng(SEED)
    noise = np.zeros((DRAWS, 3, accepted.size))
    noise[:, :, accepted] = drawn(fit.taking_of(accepted), fit.noise, DRAWS, rng)
    return noise, np.sqrt(precision) * rng.standard_normal((DRAWS, precision.size))


Teach = Callable[[BoolArray], tuple[Array, Array]]
"""Readings held out -> covariance (p, p) and slopes (k, p) of the fits to all others."""


def _independent(
    fit: Fit, observed: Array, jacobian: Array, precision: Array, pulls: Array, accepted: BoolArray
) -> Teach:
    """Readings that share no noise: the held-out ones' part is taken off the normal equations."""
    size = jacobian.shape[0]
    normal, slopes = np.diag(precision), -pulls
    for part in parts_of(accepted):
        chosen = jacobian[:, :, part].reshape(size, -1)
        normal = normal + chosen @ chosen.T
        slopes = slopes + observed[:, :, part].reshape(slopes.shape[0], -1) @ chosen.T

    def teach(held: BoolArray) -> tuple[Array, Array]:
        block = jacobian[:, :, held].reshape(size, -1)
        left = slopes - observed[:, :, held].reshape(slopes.shape[0], -1) @ block.T
        return Scaled.of(normal - block @ block.T).inverse(), left

    return teach


def _sharing(
    fit: Fit, observed: Array, jacobian: Array, precision: Array, pulls: Array, accepted: BoolArray
) -> Teach:
    """Readings that share noise: those left are freed of theirs anew."""

    def teach(held: BoolArray) -> tuple[Array, Array]:
        left = accepted & ~held
        whitening = Whitening(fit.taking_of(left), fit.noise)
        chosen = whitening.apply(jacobian[:, :, left]).reshape(jacobian.shape[0], -1)
        residuals = whitening.apply(observed[:, :, left]).reshape(observed.shape[0], -1)
        return Scaled.of(normal_matrix(chosen, precision)).inverse(), residuals @ chosen.T - pulls

    return teach
