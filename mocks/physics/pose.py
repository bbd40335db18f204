"""Poses and rotations in numpy, components last: positions (N, 3), rotations (N, 3, 3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """N poses: ``position`` (N, 3) mm and ``rotation`` (N, 3, 3) of the platform in the base."""

    position: Array
    rotation: Array

    def points(self, platform: Array) -> Array:
        """Points ``platform`` (3,) or (N, 3), platform frame, in the base frame: (N, 3)."""
        return np.asarray(
            self.position + np.einsum("nij,...j->ni" if platform.ndim == 1 else "nij,nj->ni",
                                      self.rotation, platform)
        )  # fmt: skip


def rotation_z(angle: float) -> Array:
    """Rotation about z, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_rpy(rx: float, ry: float, rz: float) -> Array:
    """Rz(rz) Ry(ry) Rx(rx), (3, 3)."""
    return np.asarray(rotations_from_rpy(np.array([[rx, ry, rz]]))[0])


def rotations_from_rpy(angles: Array) -> Array:
    """Rz(rz) Ry(ry) Rx(rx) for angles (N, 3): (N, 3, 3)."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles.T), np.sin(angles.T)
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.asarray(np.array(rows).transpose(2, 0, 1))


def rpy_from_rotation(rotation: Array) -> Array:
    """(N, 3) angles rx, ry, rz with Rz(rz) Ry(ry) Rx(rx) = rotation (N, 3, 3)."""
    rx = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    ry = np.arctan2(-rotation[:, 2, 0], np.hypot(rotation[:, 0, 0], rotation[:, 1, 0]))
    rz = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    return np.stack([rx, ry, rz], axis=1)


def rotation_from_vector(vector: Array) -> Array:
    """Rodrigues' formula for rotation vectors (N, 3): (N, 3, 3)."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None]
    skew = np.zeros((vector.shape[0], 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -vector[:, 2], vector[:, 1], -vector[:, 0]
    skew -= skew.transpose(0, 2, 1)
    safe = np.where(angle < 1e-8, 1.0, angle)
    first = np.where(angle < 1e-8, 1.0, np.sin(safe) / safe)
    second = np.where(angle < 1e-8, 0.5, (1.0 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))
