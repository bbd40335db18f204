"""Predicted accuracy: what readings at some poses tell about the platform at all poses.

With J_k the twist of the platform at pose k per unit of each unknown and K_k the root of the
readings' information there, the unknowns have the covariance C = (M0 + sum A_k^T A_k)^-1 with
A_k = K_k J_k and M0 the priors (and base nests). The platform's pose error at a fresh pose then
has the covariance J C J^T; its mean over the workspace is tr(C W). The unknowns are the machine's
parameters, in units of their prior sigma, and the six of the base frame where that is free.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import Poses
from calib.poses.reach import PoseSet
from calib.poses.readings import Readings

DIFFUSE = 1e3
"""Without priors the unknowns still get one this many times wider: it fixes only gauges."""
FRAME_SIGMA = (1e3, 1e3, 1e3, 10.0, 10.0, 10.0)
"""Prior of a free base frame, mm and rad: none to speak of."""


@dataclass(frozen=True)
class Accuracy:
    """Predicted error of the platform at fresh poses: RMS of the 3D position and of the angle.

    In the frame in which the poses are judged: the base frame as the fit places it.
    """

    position_um: float
    orientation_mdeg: float


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before the run: scale of the unknowns (p,) and information (p, p)."""

    scale: Array
    information: Array


def prior(poses: PoseSet, readings: Readings, *, priors: bool) -> Prior:
    """Prior of the machine's unknowns for a way of measuring.

    ``priors`` False: tolerances are not used (but a diffuse prior keeps gauges finite).
    """
    machine = poses.machine
    scale = machine.prior_sigma
    diagonal = np.full(len(scale), 1.0 if priors else DIFFUSE**-2)
    information = np.diag(diagonal)
    if readings.frame_free:
        frame = np.array(FRAME_SIGMA)
        p = len(scale)
        full = np.zeros((p + 6, p + 6))
        full[:p, :p] = information
        full[p:, p:] = np.eye(6) + readings.frame_information() * np.outer(frame, frame)
        scale, information = np.concatenate([scale, frame]), full
    return Prior(scale, information)


def frame_columns(poses: Poses) -> Array:
    """Twist (6, 6, N) of the platform per unit twist of the base frame at the base origin."""
    x, y, z = poses.position
    columns = np.zeros((6, 6, poses.count))
    columns[range(6), range(6)] = 1.0
    # A turn w about the base origin moves the platform's origin by w x p; first index: unknown.
    columns[3, 1], columns[3, 2] = -z, y
    columns[4, 0], columns[4, 2] = z, -x
    columns[5, 0], columns[5, 1] = -y, x
    return columns


def unknown_columns(poses: PoseSet, readings: Readings) -> Array:
    """Twist (p, 6, N), mm and rad, of the platform as the tracker sees it, per unknown."""
    J: Array = pose_jacobians(poses.machine, poses.configuration).parameters
    if readings.frame_free:
        J = np.concatenate([J, frame_columns(poses.poses)])
    return J


def whitened_rows(poses: PoseSet, readings: Readings, scale: Array) -> Array:
    """A (p, m, N): rows of unit variance per unknown in units of ``scale``; pose last."""
    J = unknown_columns(poses, readings) * scale[:, None, None]
    rows: Array = np.einsum("rin,pin->prn", readings.root(poses.poses), J)
    return rows


@dataclass(frozen=True, eq=False)
class Judge:
    """Mean over fresh poses of J^T J, position (mm^2) and orientation (rad^2) apart; (p, p)."""

    position: Array
    orientation: Array

    @classmethod
    def over(cls, poses: PoseSet, readings: Readings, scale: Array) -> "Judge":
        """Judge on the given poses."""
        J = unknown_columns(poses, readings) * scale[:, None, None]
        p = len(scale)
        v, w = J[:, :3].reshape(p, -1), J[:, 3:].reshape(p, -1)
        return cls(v @ v.T / poses.count, w @ w.T / poses.count)

    def weight(self, lever: float) -> Array:
        """W (p, p) of the criterion; an orientation counts with the ``lever`` in mm."""
        return self.position + lever**2 * self.orientation

    def accuracy(self, covariance: Array) -> Accuracy:
        """Predicted accuracy for the covariance (p, p) of the scaled unknowns."""
        position = np.sqrt(max(np.sum(covariance * self.position), 0.0))
        turn = np.sqrt(max(np.sum(covariance * self.orientation), 0.0))
        return Accuracy(float(position * 1e3), float(np.rad2deg(turn) * 1e3))


def covariance(information: Array) -> Array:
    """Inverse of a positive definite information matrix (p, p)."""
    L_inverse = np.linalg.inv(np.linalg.cholesky(information))
    C: Array = L_inverse.T @ L_inverse
    return C
