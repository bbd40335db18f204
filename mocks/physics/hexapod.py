"""The hexapod's closed form (Han et al. 2020, put right in docs/papers.md).

Limb i has fixed joint frames FB = Rz(phi_b), FP = Rz(phi_p) with columns x, y, z::

    C = B + LB n_B                    n_B unit, perpendicular to x_B, towards the leg
    D = t + R (P + LP n_P)            n_P unit, perpendicular to x_P, towards the leg
    v = D - C = l u,  u . (x_B x n_B) = 0,  u . R (x_P x n_P) = 0

The perpendicularity says that n_B is the direction of D - B projected along x_B, and R n_P that
of C - (t + R P) projected along R x_P. The two are found by going back and forth: each sweep
shrinks the error by (offset / leg length)^2, about 5e-4. Because the leg is perpendicular to both
second axes, dl/d(t, rotation vector) = [u, R (P + LP n_P) x u] holds exactly.

Arrays here are (N, 6, 3): pose, leg, component. mm and rad.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from mocks.physics.pose import Array, Pose, rotation_from_vector, rotation_z

LEGS = 6
PHI_B_DEG = (15.0, 105.0, 135.0, 225.0, 255.0, 345.0)
PHI_P_DEG = (45.0, 75.0, 165.0, 195.0, 285.0, 315.0)
HOME_Z = 220.0
FIRST_SWEEPS = 5
LATER_SWEEPS = 2
MOST_STEPS = 40
CLOSED_MM = 1e-10


@dataclass(frozen=True)
class HexapodGeometry:
    """Six legs: joint centres ``B``, ``P`` (6, 3), lengths ``L0``, ``LB``, ``LP`` (6,), frames.

    ``FB``, ``FP`` (6, 3, 3) are the joint frames in the base and in the platform frame.
    """

    B: Array
    P: Array
    L0: Array
    LB: Array
    LP: Array
    FB: Array
    FP: Array


@dataclass(frozen=True)
class Legs:
    """Legs at N poses.

    ``length`` (N, 6) mm; in the base frame, (N, 6, 3): ``u`` along the leg from C to D, ``arm``
    from the platform's origin to D, ``second_base`` x_B x n_B, ``second_platform`` R (x_P x n_P),
    ``arm_axis`` R n_P.
    """

    length: Array
    u: Array
    arm: Array
    second_base: Array
    second_platform: Array
    arm_axis: Array

    def rows(self) -> Array:
        """dl/d(t, rotation vector in the base frame), (N, 6, 6)."""
        return np.asarray(np.concatenate([self.u, np.cross(self.arm, self.u)], axis=2))

    def twist(self) -> Array:
        """Angle from base-side to platform-side second axis, right-handed about u, (N, 6), rad."""
        sine = np.sum(self.u * np.cross(self.second_base, self.second_platform), axis=2)
        cosine = np.sum(self.second_base * self.second_platform, axis=2)
        return np.asarray(np.arctan2(sine, cosine))


def geometry(
    parameters: Mapping[str, float], tilt_B: Array | None = None, tilt_P: Array | None = None
) -> HexapodGeometry:
    """Geometry from parameters ``leg1.B_x`` ...; tilts (6, 2): local rotations about y and z."""

    def triple(stem: str) -> Array:
        return np.array([[parameters[f"leg{i}.{stem}_{a}"] for a in "xyz"] for i in range(1, 7)])

    def single(stem: str) -> Array:
        return np.array([parameters[f"leg{i}.{stem}"] for i in range(1, 7)])

    def frames(degrees: tuple[float, ...], tilt: Array | None) -> Array:
        plain = np.array([rotation_z(np.radians(d)) for d in degrees])
        if tilt is None or not tilt.any():
            return plain
        vectors = np.column_stack([np.zeros(LEGS), tilt])
        return np.asarray(plain @ rotation_from_vector(vectors))

    return HexapodGeometry(
        B=triple("B"), P=triple("P"), L0=single("L0"), LB=single("L_B"), LP=single("L_P"),
        FB=frames(PHI_B_DEG, tilt_B), FP=frames(PHI_P_DEG, tilt_P),
    )  # fmt: skip


def _dot(a: Array, b: Array) -> Array:
    """Scalar products along the last axis."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _across(vectors: Array, axis: Array) -> Array:
    """Unit vectors of ``vectors`` projected along the unit ``axis``."""
    flat = vectors - _dot(vectors, axis)[..., None] * axis
    return np.asarray(flat / np.sqrt(_dot(flat, flat))[..., None])


def legs(g: HexapodGeometry, pose: Pose, n_P: Array | None = None) -> Legs:
    """Inverse kinematics: the legs that reach N poses; ``n_P`` (N, 6, 3) is a nearby start."""
    joint = pose.position[:, None, :] + np.einsum("nij,lj->nli", pose.rotation, g.P)
    x_B = g.FB[:, :, 0]
    x_P = np.einsum("nij,lj->nli", pose.rotation, g.FP[:, :, 0])
    end = joint if n_P is None else joint + g.LP[:, None] * n_P
    for _ in range(FIRST_SWEEPS if n_P is None else LATER_SWEEPS):
        n_B = _across(end - g.B, x_B)
        start = g.B + g.LB[:, None] * n_B
        n_P = _across(start - joint, x_P)
        end = joint + g.LP[:, None] * n_P
    assert n_P is not None
    v = end - start
    length = np.sqrt(_dot(v, v))
    return Legs(
        length=length, u=v / length[:, :, None], arm=end - pose.position[:, None, :],
        second_base=np.cross(x_B, n_B), second_platform=np.cross(x_P, n_P), arm_axis=n_P,
    )  # fmt: skip


def home_pose(count: int) -> Pose:
    """``count`` copies of the nominal home pose."""
    position = np.tile([0.0, 0.0, HOME_Z], (count, 1))
    return Pose(position, np.tile(np.eye(3), (count, 1, 1)))


def forward(
    g: HexapodGeometry, wanted: Callable[[Legs, Pose], Array], start: Pose
) -> tuple[Pose, Legs]:
    """Poses at which every leg has the length that it should have.

    Newton on the closed-form lengths from ``start`` (N poses). ``wanted(legs, pose)`` gives the
    lengths (N, 6) in mm; it may depend weakly on the pose (twist, load). Raises ArithmeticError
    if the legs cannot close.
    """
    pose, n_P = start, None
    for _ in range(MOST_STEPS):
        found = legs(g, pose, n_P)
        residual = wanted(found, pose) - found.length
        if float(np.max(np.abs(residual), initial=0.0)) < CLOSED_MM:
            return pose, found
        step: Array = np.asarray(
            np.linalg.solve(found.rows(), residual[:, :, None])[:, :, 0], dtype=np.float64
        )
        turn = rotation_from_vector(step[:, 3:])
        pose = Pose(pose.position + step[:, :3], turn @ pose.rotation)
        n_P = found.arm_axis
    raise ArithmeticError(f"the legs do not close: {np.max(np.abs(residual)):.3g} mm are left")
