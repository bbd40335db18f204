"""How far a machine is from where it will be once it is warm, by a model with a warm-up in it."""

import numpy as np

from app.auto.decision import Creep
from app.jobs.corrector import Corrector
from calib.arrays import Array
from calib.chance import chi2_above
from calib.mechanism.axes import units_of
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse

WARMING = ("warm-up", "leg-warm-up")
"""Effects that fade by A exp(-t / tau) from the start of a run."""
NOTHING = 0.01
"""A chi-square that is met by chance more often than this is no sign of a warm-up."""


def creep_of(corrector: Corrector, last_s: float, poses: Array) -> Creep | None:
    """What is left of the larger warm-up of a model; None without one.

    Parameters
    ----------
    corrector : Corrector
        With the model.
    last_s : float
        When the last of its runs ended, s since that run began.
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
    effects = [name for name in corrector.saved.effects if name in WARMING]
    if not effects:
        return None
    by_axis = _per_axis(corrector, poses)
    every = [_left(corrector, effect, last_s, by_axis) for effect in effects]
    return max(every, key=lambda creep: creep.left_um)


def _per_axis(corrector: Corrector, poses: Array) -> Array:
    """Motion (n, 3, N) of the platform's origin per mm or rad of each actuator."""
    machine, held = corrector.machine, corrector.identified.parameters
    at = inverse(machine, Poses.from_xyz_rpy(poses), held)
    return np.asarray(pose_jacobians(machine, at, held).actuators[:, :3])


def _left(corrector: Corrector, effect: str, last_s: float, by_axis: Array) -> Creep:
    names, share = _amplitudes(corrector, effect)
    tau = f"{effect}.tau"
    estimates = corrector.saved.estimates
    found, tau_s = np.array([estimates[name].value for name in names]), estimates[tau].value
    moves = float(np.exp(-last_s / tau_s)) * np.einsum("un,nkp->ukp", share, by_axis)
    left = np.einsum("u,ukp->kp", found, moves)
    covariance = corrector.saved.covariance_of([*names, tau])
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    told = float(found @ np.linalg.pinv(covariance)[:-1, :-1] @ found)
    if chi2_above(found.size, told) > NOTHING:
        return Creep(effect, 0.0, tau_s / 60.0)
    slopes = np.concatenate([moves, left[None] * last_s / tau_s**2])
    open_ = float(np.einsum("ukp,uv,vkp->", slopes, covariance, slopes))
    square = (float(np.sum(left**2)) + open_) / by_axis.shape[2]
    return Creep(effect, 1e3 * float(np.sqrt(square)), tau_s / 60.0)


def _amplitudes(corrector: Corrector, effect: str) -> tuple[list[str], Array]:
    """Names of the last run's amplitudes, and what each is of every actuator, (U, n)."""
    axes, runs = corrector.machine.axes, corrector.saved.runs
    stem = f"{effect}.run{len(runs)}." if len(runs) > 1 else f"{effect}."
    if effect == "leg-warm-up":
        return [stem + axis.name for axis in axes], np.eye(len(axes))
    units = units_of(axes)
    share = np.zeros((len(units), len(axes)))
    names = []
    for number, which in enumerate(units.values()):
        size = np.array([axes[k].lost_motion for k in which])
        share[number, which] = size / size[0]
        names.append(f"{stem}A" + (f"_{axes[which[0]].kind}" if len(units) > 1 else ""))
    return names, share
