"""Parameters from measured poses: Gauss-Newton on the poses themselves, as the papers do.

The program's own identification works on tracker readings (``calib.identify``); the papers measure
whole poses, or positions.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, IntArray
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import Poses, pose_difference
from calib.mechanism.solve import Configuration, forward


@dataclass(frozen=True, eq=False)
class PoseFit:
    """``values`` (P,) of all parameters; ``covariance`` (F, F) of the free ones; ``residual``
    (6, N) twists from the fitted to the measured poses, mm and rad; ``steps`` taken.
    """

    values: Array
    covariance: Array
    residual: Array
    steps: int


def fit_poses(
    machine: Machine,
    start: Configuration,
    measured: Poses,
    sigma: Array,
    free: IntArray | None = None,
    prior: Array | None = None,
    max_steps: int = 25,
) -> PoseFit:
    """Fit parameters to measured poses.

    Parameters
    ----------
    start : Configuration of N poses
        The nominal machine at the commanded extensions.
    measured : Poses
    sigma : (6,)
        Standard deviations of the measured position (mm) and orientation (rad); ``inf`` leaves a
        coordinate out.
    free : indices of the parameters that are fitted, optional
        All if not given.
    prior : (F,), optional
        Standard deviations about nominal. Without, combinations that the poses do not show keep
        their nominal value (least norm, each parameter in units of its tolerance).
    """
    which = np.arange(len(machine.parameters)) if free is None else free
    scale = machine.prior_sigma[which] if prior is None else prior
    values, now, damping = machine.nominal.copy(), start, 0.0
    error, J, cost = _linearised(machine, values, now, measured, sigma, which, scale, prior)
    steps = 0
    while steps < max_steps:
        steps += 1
        step = _step(J, error, damping)
        trial = values.copy()
        trial[which] += scale * step
        after = forward(machine, start.extension, trial, start=now)
        if np.all(after.converged):
            linear = _linearised(machine, trial, after, measured, sigma, which, scale, prior)
            if linear[2] <= cost * (1.0 + 1e-12):
                small = cost - linear[2] <= 1e-10 * cost or linear[2] < 1e-20
                values, now, (error, J, cost) = trial, after, linear
                damping /= 10.0
                if small:
                    break
                continue
        if np.linalg.norm(step) < 1e-9:
            break
        damping = max(10.0 * damping, 1e-3 * float(np.max(np.sum(J * J, axis=0))))
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-20, hermitian=True)
    covariance = inverse * np.outer(scale, scale)
    return PoseFit(values, covariance, pose_difference(now.poses, measured), steps)


def _step(J: Array, error: Array, damping: float) -> Array:
    if damping < 1e-12:
        return np.asarray(np.linalg.lstsq(J, error, rcond=1e-12)[0], dtype=float)
    count = J.shape[1]
    damped = np.concatenate([J, np.sqrt(damping) * np.eye(count)])
    right = np.concatenate([error, np.zeros(count)])
    return np.asarray(np.linalg.lstsq(damped, right, rcond=None)[0], dtype=float)


def _linearised(
    machine: Machine,
    values: Array,
    now: Configuration,
    measured: Poses,
    sigma: Array,
    which: IntArray,
    scale: Array,
    prior: Array | None,
) -> tuple[Array, Array, float]:
    """Weighted errors, their derivative by the scaled parameters, and half the cost."""
    weight = 1.0 / sigma
    error = (pose_difference(now.poses, measured) * weight[:, None]).ravel()
    twists = pose_jacobians(machine, now, values).parameters[which]
    J = (twists * weight[:, None] * scale[:, None, None]).reshape(len(which), -1).T
    if prior is not None:
        J = np.concatenate([J, np.eye(len(which))])
        error = np.concatenate([error, (machine.nominal - values)[which] / prior])
    return error, J, float(error @ error)
