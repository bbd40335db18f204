"""How far a machine is from where it will be once it is warm, by a model with a warm-up in it."""

import numpy as np

from app.auto.decision import Creep
from calib.arrays import Array
from calib.chance import chi2_above
from calib.identify import Fit
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse

WARMING = ("warm-up", "leg-warm-up")
"""Effects that fade by A exp(-t / tau) from the start of a run."""
NOTHING = 0.01
"""A chi-square that is met by chance more often than this is no sign of a warm-up."""


def creep_of(fit: Fit, poses: Array) -> Creep | None:
    """What is left of the larger warm-up of a model when its last run ended; None without one.

    Parameters
    ----------
    fit : Fit
        Of the model to its runs.
    poses : array, shape (6, N)
        Where it is to be accurate: x, y, z in mm, rx, ry, rz in rad.

    Notes
    -----
    The platform is J a exp(-t / tau) from where it will be, with amplitudes a and J (3N, U) from
    them to its place; with covariance C of a and tau, and slopes S of that by them, tr(S C S^T) / N
    is added to its mean square: what is to be expected of it. In a short run what an exponential
    changes is well known, where it ends is not. Where a chi-square of a, with tau as it is, finds
    nothing in the last run (p above 0.01), the machine was warm, and nothing is left.
    """
    warming = [k for k, effect in enumerate(fit.model.effects) if effect.id in WARMING]
    if not warming:
        return None
    by_axis = _per_axis(fit, poses)
    return max((_left(fit, number, by_axis) for number in warming), key=lambda one: one.left_um)


def _per_axis(fit: Fit, poses: Array) -> Array:
    """Motion (n, 3, N) of the platform's origin per mm or rad of each actuator."""
    machine, held = fit.model.machine, fit.linear.state.parameters
    at = inverse(machine, Poses.from_xyz_rpy(poses), held)
    return np.asarray(pose_jacobians(machine, at, held).actuators[:, :3])


def _left(fit: Fit, number: int, by_axis: Array) -> Creep:
    """What an effect of the model leaves at the last reading, by its own signature there."""
    effect, unknowns = fit.model.effects[number], fit.model.unknowns[number]
    situation, values = fit.linear.situation, fit.linear.state.effects[number]
    ended = np.lexsort((situation.rows.time_s, situation.rows.run))[-1]
    extension = effect.signature(situation, values).extension
    assert extension is not None
    slopes = np.einsum("un,nkp->ukp", extension[:, :, ended], by_axis)
    fading = np.array([unknown.nonlinear for unknown in unknowns])
    left = np.einsum("u,ukp->kp", np.where(fading, 0.0, values), slopes)
    at = [fit.model.names.index(unknown.name) for unknown in unknowns]
    covariance = fit.covariance[np.ix_(at, at)]
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    here = np.any(extension[:, :, ended] != 0.0, axis=1) | fading  # not those of other runs
    found = np.where(fading, 0.0, values)[here]
    told = float(found @ np.linalg.pinv(covariance[np.ix_(here, here)]) @ found)
    (tau_min,) = values[fading] / 60.0
    if chi2_above(int(np.count_nonzero(here & ~fading)), told) > NOTHING:
        return Creep(effect.id, 0.0, float(tau_min))
    open_ = float(np.einsum("ukp,uv,vkp->", slopes, covariance, slopes))
    square = (float(np.sum(left**2)) + open_) / by_axis.shape[2]
    return Creep(effect.id, 1e3 * float(np.sqrt(square)), float(tau_min))
