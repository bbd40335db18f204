"""Rotations and poses, component first and pose last.

A rotation is an array (3, 3, ...) with ``R[i, j]`` row i, column j; a vector is (3, ...). All
functions are analytic in the sense of complex step: no conjugate, no absolute value.
R = Rz(rz) Ry(ry) Rx(rx) throughout.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Numbers, Selection


def cross(a: Numbers, b: Numbers) -> Numbers:
    """Cross product of (3, ...) vectors."""
    a0, a1, a2 = a
    b0, b1, b2 = b
    first = a1 * b2
    out = np.empty((3, *first.shape), dtype=first.dtype)
    np.subtract(first, a2 * b1, out=out[0])
    np.subtract(a2 * b0, a0 * b2, out=out[1])
    np.subtract(a0 * b1, a1 * b0, out=out[2])
    return out


def rotate(R: Numbers, v: Numbers) -> Numbers:
    """R v for R (3, 3, ...) and v (3, ...)."""
    out: Numbers = R[:, 0] * v[0] + R[:, 1] * v[1] + R[:, 2] * v[2]
    return out


def product(A: Numbers, B: Numbers) -> Numbers:
    """A B of rotations (3, 3, ...)."""
    return np.stack([rotate(A, B[:, j]) for j in range(3)], axis=1)


def from_euler(rx: Numbers, ry: Numbers, rz: Numbers) -> Numbers:
    """R = Rz(rz) Ry(ry) Rx(rx), shape (3, 3, ...); angles in rad (Han et al., below eq. 2)."""
    ca, sa, cb, sb, cg, sg = np.cos(rx), np.sin(rx), np.cos(ry), np.sin(ry), np.cos(rz), np.sin(rz)
    return np.array(
        [
            [cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa],
            [sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa],
            [-sb, cb * sa, cb * ca],
        ]
    )


def to_euler(R: Array) -> Array:
    """Angles rx, ry, rz (3, ...) in rad of R = Rz Ry Rx; ry in [-pi/2, pi/2]."""
    ry = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    return np.array([np.arctan2(R[2, 1], R[2, 2]), ry, np.arctan2(R[1, 0], R[0, 0])])


def euler_rates(R: Array) -> Array:
    """Matrix E (3, 3, ...) with d(rx, ry, rz) = E omega, omega in base axes."""
    rx, ry, rz = to_euler(R)
    del rx
    cb, sb, cg, sg = np.cos(ry), np.sin(ry), np.cos(rz), np.sin(rz)
    zero, one = np.zeros_like(cb), np.ones_like(cb)
    return np.array([[cg / cb, sg / cb, zero], [-sg, cg, zero], [cg * sb / cb, sg * sb / cb, one]])


def exponential(w: Numbers) -> Numbers:
    """Rotation (3, 3, ...) of the rotation vector w (3, ...) in rad (Rodrigues)."""
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    small = np.real(square) < 1e-8
    angle = np.sqrt(np.where(small, 1.0, square))
    a = np.where(small, 1.0 - square / 6.0 * (1.0 - square / 20.0), np.sin(angle) / angle)
    b = np.where(small, 0.5 - square / 24.0, (1.0 - np.cos(angle)) / (angle * angle))
    x, y, z = w
    bx, by, bz = b * x, b * y, b * z
    ax, ay, az = a * x, a * y, a * z
    return np.array(
        [
            [1.0 - by * y - bz * z, bx * y - az, bx * z + ay],
            [bx * y + az, 1.0 - bx * x - bz * z, by * z - ax],
            [bx * z - ay, by * z + ax, 1.0 - bx * x - by * y],
        ]
    )


def logarithm(R: Array) -> Array:
    """Rotation vector (3, ...) in rad of R, right up to 180 deg."""
    vex = 0.5 * np.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = np.sqrt(np.sum(vex * vex, axis=0))
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    factor = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1.0), 1.0)
    vector = factor * vex
    turned = (cosine < 0.0) & (sine < 1e-6)
    if np.any(turned):
        # Near 180 deg the skew part vanishes; the axis is the largest column of R + I.
        symmetric = 0.5 * (R + np.swapaxes(R, 0, 1)) + np.eye(3).reshape(
            (3, 3) + (1,) * (R.ndim - 2)
        )
        best = np.argmax(np.sum(symmetric**2, axis=0), axis=0)
        axis = np.take_along_axis(symmetric, best[None, None], axis=1)[:, 0]
        axis = axis / np.sqrt(np.sum(axis**2, axis=0))
        along = np.where(np.sum(axis * vex, axis=0) < 0.0, -1.0, 1.0)
        vector = np.where(turned, along * angle * axis, vector)
    return vector


def small_rotation(A: Numbers, B: Numbers) -> Numbers:
    """Vector of the rotation that takes A to B, exact to first order; both (3, 3, ...)."""
    total = cross(A[:, 0], B[:, 0])
    total += cross(A[:, 1], B[:, 1])
    total += cross(A[:, 2], B[:, 2])
    total *= 0.5
    return total


@dataclass(frozen=True, eq=False)
class Poses:
    """Platform poses in the base frame: position (3, N) in mm, rotation (3, 3, N)."""

    position: Array
    rotation: Array

    @classmethod
    def from_xyz_rpy(cls, values: Array) -> "Poses":
        """Build from (6, N): x, y, z in mm and rx, ry, rz in rad; R = Rz(rz) Ry(ry) Rx(rx)."""
        values = np.asarray(values)
        return cls(values[:3].copy(), from_euler(*values[3:]))

    def to_xyz_rpy(self) -> Array:
        """Coordinates x, y, z (mm), rx, ry, rz (rad), shape (6, N)."""
        return np.concatenate([self.position, to_euler(self.rotation)])

    @property
    def count(self) -> int:
        """Number of poses N."""
        return int(self.position.shape[1])

    def points(self, local: Array) -> Array:
        """Points fixed to the platform, in the base frame: local (3, N) or (3, 1) -> (3, N)."""
        return self.position + rotate(self.rotation, local)

    def take(self, which: Selection) -> "Poses":
        """Poses selected by an index, slice or mask along the last axis."""
        return Poses(self.position[:, which], self.rotation[:, :, which])


def pose_difference(a: Poses, b: Poses) -> Array:
    """Twist (6, N) from a to b: b.position - a.position (mm), rotation vector (rad, base axes)."""
    relative = product(b.rotation, np.swapaxes(a.rotation, 0, 1))
    return np.concatenate([b.position - a.position, logarithm(relative)])
