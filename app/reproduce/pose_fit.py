"""Parameters from measured poses: damped Gauss-Newton on the poses themselves, as the papers do.

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

DAMPING = 1e-8
"""First damping, as a part of the largest curvature: without, one set of nine poses in ten leads
astray; with it none of sixty, in at most six steps."""


@dataclass(frozen=True, eq=False)
class PoseFit:
    """``values`` (P,) of all parameters; ``covariance`` (F, F) of the free ones; ``residual``
    (6, N) twists from the fitted to the measured poses, mm and rad; ``updates``: largest change of
    a parameter at each step.
    """

    values: Array
    covariance: Array
    residual: Array
    updates: tuple[float, ...]


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
    sigma : (6,), or weights (k, 6, N)
        Standard deviations of the measured position (mm) and orientation (rad); ``inf`` leaves a
        coordinate out. Or what is made small: k combinations of each pose's error.
    free : indices of the parameters that are fitted, optional
        All if not given.
    prior : (F,), optional
        Standard deviations about nominal. Without, combinations that the poses do not show keep
        their nominal value (least norm, each parameter in units of its tolerance).
    """
    which = np.arange(len(machine.parameters)) if free is None else free
    scale = machine.prior_sigma[which] if prior is None else prior
    values, now = machine.nominal.copy(), start
    error, J, cost = _linearised(machine, values, now, measured, sigma, which, scale, prior)
    damping = DAMPING * float(np.max(np.sum(J * J, axis=0)))
    updates: list[float] = []
    while len(updates) < max_steps:
        step = _step(J, error, damping)
        updates.append(float(np.max(np.abs(scale * step))))
        trial = values.copy()
        trial[which] += scale * step
        after = forward(machine, start.extension, trial, start=now)
        if np.all(after.converged):
            linear = _linearised(machine, trial, after, measured, sigma, which, scale, prior)
            if linear[2] <= cost * (1.0 + 1e-12):
                small = cost - linear[2] <= 1e-10 * cost or linear[2] < 1e-20
                values, now, (error, J, cost) = trial, after, linear
                damping /= 100.0
                if small:
                    break
                continue
        if np.linalg.norm(step) < 1e-9:
            break
        damping = max(10.0 * damping, 1e-3 * float(np.max(np.sum(J * J, axis=0))))
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-20, hermitian=True)
    covariance = inverse * np.outer(scale, scale)
    return PoseFit(values, covariance, pose_difference(now.poses, measured), tuple(updates))


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
    error = pose_difference(now.poses, measured)
    twists = pose_jacobians(machine, now, values).parameters[which] * scale[:, None, None]
    if sigma.ndim == 1:
        error, twists = error / sigma[:, None], twists / sigma[:, None]
    else:
        error = np.einsum("kin,in->kn", sigma, error)
        twists = np.einsum("kin,pin->pkn", sigma, twists)
    error, J = error.ravel(), twists.reshape(len(which), -1).T
    if prior is not None:
        J = np.concatenate([J, np.eye(len(which))])
        error = np.concatenate([error, (machine.nominal - values)[which] / prior])
    return error, J, float(error @ error)
