"""The hexapod of Han et al. 2020 by hand, vectorised over poses and legs, to race the engine.

Leg from C = B + LB n_B to D = t + R (P + LP n_P); the arms n_B, n_P lie in the planes of the
first axes, each pointing along the projection of what it carries (u is perpendicular to both
second axes). Lengths are stationary in the arms, so neither Jacobian has a term in psi.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from calib.arrays import Array
from calib.mechanism.description import Machine

NAMES = ("B_x", "B_y", "B_z", "P_x", "P_y", "P_z", "L0", "L_B", "L_P")
PHI_B = np.deg2rad([15.0, 105.0, 135.0, 225.0, 255.0, 345.0])
PHI_P = np.deg2rad([45.0, 75.0, 165.0, 195.0, 285.0, 315.0])


@dataclass(frozen=True, eq=False)
class Legs:
    """Legs at N poses: position (3, N), rotation (3, 3, N), the rest (3, 6, N) or (6, N)."""

    position: Array
    rotation: Array
    u: Array
    length: Array
    base_arm: Array
    platform_arm: Array
    arm: Array
    """R (P + LP n_P)."""


def _turned(R: Array, v: Array) -> Array:
    return R[:, 0][:, None] * v[0] + R[:, 1][:, None] * v[1] + R[:, 2][:, None] * v[2]


def _dot(a: Array, b: Array) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Array, b: Array) -> Array:
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


class HexapodClosedForm:
    """Forward kinematics and error Jacobian of the nominal hexapod."""

    def __init__(self, machine: Machine) -> None:
        values = machine.nominal.reshape(6, 9).T
        self.B, self.P = values[:3, :, None], values[3:6, :, None]
        self.L0, self.LB, self.LP = values[6, :, None], values[7, :, None], values[8, :, None]
        zero = np.zeros(6)
        self.y_B = np.array([-np.sin(PHI_B), np.cos(PHI_B), zero])[:, :, None]
        self.y_P = np.array([-np.sin(PHI_P), np.cos(PHI_P), zero])[:, :, None]
        self.home = np.array(machine.home[:3])

    def legs(self, t: Array, R: Array, n_B: Array, n_P: Array, turns: int) -> Legs:
        """Legs at the poses t (3, N), R (3, 3, N); arms start from n_B, n_P (3, 6, N)."""
        y_P, z_P = _turned(R, self.y_P), R[:, 2][:, None]
        P = t[:, None] + _turned(R, self.P)
        for _ in range(turns):
            D = P + self.LP * n_P
            reach = D - self.B
            along, up = _dot(reach, self.y_B), reach[2]
            n_B = (along * self.y_B + up * np.array([0.0, 0.0, 1.0])[:, None, None]) / np.hypot(
                along, up
            )
            C = self.B + self.LB * n_B
            reach = C - P
            along, up = _dot(reach, y_P), _dot(reach, z_P)
            n_P = (along * y_P + up * z_P) / np.hypot(along, up)
        arm = P + self.LP * n_P - t[:, None]
        v = arm + t[:, None] - C
        length = np.sqrt(_dot(v, v))
        return Legs(t, R, v / length, length, n_B, n_P, arm)

    def forward(self, extension: Array) -> Legs:
        """Poses for extensions (6, N), by Newton from home with the exact Jacobian."""
        count = extension.shape[1]
        t = np.repeat(self.home[:, None], count, axis=1)
        R = np.repeat(np.eye(3)[:, :, None], count, axis=2)
        n_B = np.zeros((3, 6, count))
        n_B[2] = 1.0
        n_P, turns = -n_B, 4
        for _ in range(20):
            legs = self.legs(t, R, n_B, n_P, turns)
            J = np.concatenate([legs.u, _cross(legs.arm, legs.u)])
            gap = self.L0 + extension - legs.length
            step = np.linalg.solve(J.transpose(2, 1, 0), gap.T[:, :, None])[:, :, 0].T
            t, R = t + step[:3], _exponential(step[3:], R)
            n_B, n_P, turns = legs.base_arm, legs.platform_arm, 2
            if np.max(np.abs(step[:3])) < 1e-8 and np.max(np.abs(step[3:])) < 1e-10:
                break
        return self.legs(t, R, n_B, n_P, 3)

    def jacobian(self, legs: Legs) -> Array:
        """Twist (54, 6, N) of the platform per unit of each parameter."""
        u, R = legs.u, legs.rotation
        count = u.shape[2]
        J = np.concatenate([u, _cross(legs.arm, u)]).transpose(2, 1, 0)
        inverse = np.linalg.inv(J).transpose(1, 2, 0)
        # A longer leg is held to its length: what a parameter adds, the pose takes away.
        added = np.empty((6, 9, count))
        added[:, 0:3] = -u.transpose(1, 0, 2)
        added[:, 3:6] = np.einsum("jin,jln->lin", R, u)
        added[:, 6] = -1.0
        added[:, 7] = -_dot(u, legs.base_arm)
        added[:, 8] = _dot(u, legs.platform_arm)
        out: Array = -np.einsum("iln,lkn->lkin", inverse, added).reshape(54, 6, count)
        return out


def _exponential(w: Array, R: Array) -> Array:
    angle = np.sqrt(_dot(w, w))
    half = 0.5 * angle
    s = np.where(angle > 1e-9, np.sin(half) / np.where(angle > 1e-9, angle, 1.0), 0.5)
    x, y, z = s * w
    c = np.cos(half)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * c), 2 * (x * z + y * c)],
            [2 * (x * y + z * c), 1 - 2 * (x * x + z * z), 2 * (y * z - x * c)],
            [2 * (x * z - y * c), 2 * (y * z + x * c), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.einsum("ijn,jkn->ikn", turn, R)


class PoseFirst:
    """The same equations with arrays (N, 6, 3), matrix products and numpy's batched solvers."""

    def __init__(self, machine: Machine) -> None:
        values = machine.nominal.reshape(6, 9)
        self.B, self.P = values[:, :3], values[:, 3:6]
        self.L0, self.LB, self.LP = values[:, 6], values[:, 7:8], values[:, 8:9]
        zero, one = np.zeros(6), np.ones(6)
        self.x_B = np.stack([np.cos(PHI_B), np.sin(PHI_B), zero], axis=-1)
        self.x_P = np.stack([np.cos(PHI_P), np.sin(PHI_P), zero], axis=-1)
        self.up = np.stack([zero, zero, one], axis=-1)
        self.home = np.array(machine.home[:3])

    def legs(self, t: Array, R: Array, turns: int) -> tuple[Array, Array, Array, Array, Array]:
        """Unit vectors, lengths, arms of base and platform, and R (P + LP n_P)."""
        P = t[:, None] + self.P @ R.transpose(0, 2, 1)
        x_P = self.x_P @ R.transpose(0, 2, 1)
        n_P = -np.broadcast_to(R[:, None, :, 2], P.shape)
        for _ in range(turns):
            n_B = self._perpendicular(P + self.LP * n_P - self.B, self.x_B)
            C = self.B + self.LB * n_B
            n_P = self._perpendicular(C - P, x_P)
        D = P + self.LP * n_P
        v = D - C
        length = np.linalg.norm(v, axis=2)
        return v / length[:, :, None], length, n_B, n_P, D - t[:, None]

    @staticmethod
    def _perpendicular(reach: Array, axis: Array) -> Array:
        """Unit vector along the part of ``reach`` that is perpendicular to ``axis``."""
        across = reach - np.sum(reach * axis, axis=2, keepdims=True) * axis
        unit: Array = across / np.linalg.norm(across, axis=2, keepdims=True)
        return unit

    def forward(self, extension: Array) -> tuple[Array, Array]:
        """Positions (N, 3) and rotations (N, 3, 3) for extensions (N, 6), by Newton from home."""
        count = len(extension)
        t = np.tile(self.home, (count, 1))
        R = np.tile(np.eye(3), (count, 1, 1))
        for _ in range(20):
            u, length, _, _, arm = self.legs(t, R, 3)
            J = np.concatenate([u, np.cross(arm, u)], axis=2)
            step = np.linalg.solve(J, (self.L0 + extension - length)[:, :, None])[:, :, 0]
            t = t + step[:, :3]
            R = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R
            if np.max(np.abs(step[:, :3])) < 1e-8 and np.max(np.abs(step[:, 3:])) < 1e-10:
                break
        return t, R

    def jacobian(self, t: Array, R: Array) -> Array:
        """Twist (N, 6, 54) of the platform per unit of each parameter."""
        u, _, n_B, n_P, arm = self.legs(t, R, 3)
        J = np.concatenate([u, np.cross(arm, u)], axis=2)
        change = np.concatenate(
            [
                -u,
                u @ R,
                -np.ones((*u.shape[:2], 1)),
                -np.sum(u * n_B, axis=2, keepdims=True),
                np.sum(u * n_P, axis=2, keepdims=True),
            ],
            axis=2,
        )
        rows = np.zeros((len(t), 6, 54))
        for leg in range(6):
            rows[:, leg, 9 * leg : 9 * leg + 9] = change[:, leg]
        return -np.linalg.solve(J, rows)
