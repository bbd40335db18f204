"""Geometry of the over-constrained tracking mechanism (Zhang et al. 2018; docs/papers.md).

Four limbs of two links stand at 90 deg around the base: R joint, lower link, S joint, upper link,
R joint. A rod between two S joints stands in the middle. Home: the platform is the mirror image of
the base in the plane z = H / 2, in which the S joints of the limbs lie. The 83 errors carry the
paper's names; those of a frame stand at its origin, along the axes of the frame before it.

An S joint is three R joints whose axes do not quite meet. Its angles follow in closed form from
the orientations of the two links, so that a limb is described by its gap: where the upper link
wants its end of the S joint, less where the lower link has it. mm and rad; arrays (N, 4, ...) are
pose, limb.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mocks.physics.pose import Array, rotation_z

LIMBS: tuple[str, ...] = ("limb1", "limb2")
RSR: tuple[str, ...] = ("limb1", "limb2", "limb3", "limb4")
DRIVEN = 2
RADIUS, LINK, ROD = 150.0, 317.0, 402.0
THETA_L = float(np.arccos(75.0 / LINK))
THETA_H = float(np.radians(22.1))
LOWER = (LINK * float(np.sin(THETA_L)), -75.0)
UPPER = (LINK * float(np.sin(THETA_H)), LINK * float(np.cos(THETA_H)))
# At home the lower link rises at acos(201 / 317) from the vertical; LOWER points THETA_L - 90 deg.
HOME_TURN = float(np.arcsin(75.0 / LINK) - np.arcsin(0.5 * ROD / LINK))


@dataclass(frozen=True)
class PtmGeometry:
    """True dimensions.

    ``base`` (4, 3, 3) and ``base_at`` (4, 3): frame of the base joint, which turns about its z;
    ``zero`` (4,): its angle at q = 0; ``lower`` (4, 3): S joint in the lower link; ``second``,
    ``third`` (4, 3): from axis 2 to 3 and from 3 to 4 of the S joint; ``upper`` (4, 3): from axis
    4 to the platform joint; ``tilt`` (4,): turn of that joint on the link; ``top`` (4, 3, 3) and
    ``top_at`` (4, 3): frame of the platform joint, platform axes. Rod: ``rod_base``, ``rod_top``
    (3,), arms ``rod_arms`` (base, platform) and ``rod_length``.
    """

    base: Array
    base_at: Array
    zero: Array
    lower: Array
    second: Array
    third: Array
    upper: Array
    tilt: Array
    top: Array
    top_at: Array
    rod_base: Array
    rod_top: Array
    rod_arms: tuple[float, float]
    rod_length: float


def rotation_x(angle: float) -> Array:
    """Rotation about x, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


QUARTER = 0.5 * np.pi


def geometry(errors: Mapping[str, float]) -> PtmGeometry:
    """Geometry with errors ``limb1.dtheta`` ... ``limb5.6dz5`` in mm and rad."""

    def error(limb: str, *names: str) -> Array:
        return np.array([errors.get(f"{limb}.{name}", 0.0) for name in names])

    base, base_at, top, top_at = [], [], [], []
    for number, limb in enumerate(RSR):
        place = rotation_z(number * QUARTER)
        out = np.array([RADIUS, 0.0, 0.0])
        alpha, gamma = error(limb, "0da1", "0dg1")
        base_at.append(place @ (out + error(limb, "0dx1", "0dy1", "0dz1")))
        base.append(place @ rotation_x(alpha) @ rotation_z(gamma) @ rotation_x(-QUARTER))
        alpha, gamma = error(limb, "6da5", "6dg5")
        turned = place @ np.eye(3)
        # Seen from the platform: outwards by the radius, then the errors, turns before shifts.
        turned = turned @ rotation_z(gamma) @ rotation_x(alpha)
        top_at.append(place @ out + turned @ error(limb, "6dx5", "6dy5", "6dz5"))
        top.append(turned @ rotation_z(np.pi) @ rotation_x(-QUARTER))

    def each(*names: str) -> Array:
        return np.array([error(limb, *names) for limb in RSR])

    nothing = np.zeros((4, 1))
    lower = np.hstack([each("1dx2", "1dy2") + LOWER, nothing])
    along = each("4dx5", "4dz5") + UPPER
    arms = error("limb5", "1dx2", "4dx5")
    return PtmGeometry(
        base=np.array(base),
        base_at=np.array(base_at),
        zero=HOME_TURN + each("dtheta")[:, 0],
        lower=lower,
        second=np.hstack([each("2dx3"), nothing, nothing]),
        third=np.hstack([each("3dx4"), nothing, each("3dz4")]),
        upper=np.stack([along[:, 0], np.zeros(4), along[:, 1]], axis=1),
        tilt=each("4da5")[:, 0],
        top=np.array(top),
        top_at=np.array(top_at),
        rod_base=error("limb5", "0dx1", "0dy1", "0dz1"),
        rod_top=error("limb5", "6dx5", "6dy5", "6dz5"),
        rod_arms=(float(arms[0]), float(arms[1])),
        rod_length=ROD + float(error("limb5", "3dz4")[0]),
    )


def turns_z(angle: Array) -> Array:
    """Rotations about z for angles (...,): (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    out = np.zeros((*angle.shape, 3, 3))
    out[..., 0, 0], out[..., 0, 1] = c, -s
    out[..., 1, 0], out[..., 1, 1] = s, c
    out[..., 2, 2] = 1.0
    return out


S_BASE = rotation_x(QUARTER) @ rotation_z(np.pi)
S_MIDDLE = rotation_x(QUARTER) @ rotation_z(QUARTER)


@dataclass(frozen=True)
class Gaps:
    """Gaps of the RSR limbs and the rod's, with their derivatives.

    ``gap`` (N, 4, 3) mm in base axes; ``by_pose`` (N, 4, 3, 6) by [v of the platform's origin;
    rotation vector]; ``by_bottom``, ``by_top`` (N, 4, 3) by the angles of base and platform joint;
    ``free`` (N, 4, 3): unit constraint force, which works at neither joint; ``rod`` (N,) mm, the
    rod's stretch; ``rod_by_pose`` (N, 6).
    """

    gap: Array
    by_pose: Array
    by_bottom: Array
    by_top: Array
    free: Array
    rod: Array
    rod_by_pose: Array


def gaps(
    g: PtmGeometry, grown: Array, position: Array, rotation: Array, bottom: Array, top: Array
) -> Gaps:
    """Gaps at N poses with joint angles ``bottom``, ``top`` (N, 4) from home.

    ``grown`` (N,) is the factor by which all links have grown.
    """
    scale = grown[:, None, None]
    lower_turn = g.base @ turns_z(bottom + g.zero)
    s_arm = np.einsum("nkij,kj->nki", lower_turn, g.lower) * scale
    s_base = lower_turn @ S_BASE
    axis_1 = g.base[:, :, 2]
    # Upper link from the platform: back through the joint, then along the link.
    joint = rotation[:, None] @ g.top
    arm = np.einsum("nij,kj->nki", rotation, g.top_at)
    axis_5 = joint[..., 2]
    bend = np.array([rotation_x(-QUARTER - tilt) for tilt in g.tilt])
    link = joint @ turns_z(-top - QUARTER) @ bend
    back = -np.einsum("nkij,kj->nki", link, g.upper) * scale
    # Angles of the S joint: R_s = Rz(a) Rx(90) Rz(90 + b) Rx(90) Rz(c).
    between = np.swapaxes(s_base, -1, -2) @ link
    a = np.arctan2(between[..., 1, 2], between[..., 0, 2])
    b = np.arctan2(np.hypot(between[..., 0, 2], between[..., 1, 2]), -between[..., 2, 2]) - QUARTER
    after_2 = s_base @ turns_z(a)
    third = after_2 @ S_MIDDLE
    after_3 = third @ turns_z(b)
    step_2 = np.einsum("nkij,kj->nki", after_2, g.second)
    step_3 = np.einsum("nkij,kj->nki", after_3, g.third)
    offset = step_2 + step_3
    gap = position[:, None] + arm + back - g.base_at - s_arm - offset
    # How the S joint turns when the links do: rho = a2 d2 + a3 d3 + a4 d4.
    a2, a3, a4 = s_base[..., 2], third[..., 2], link[..., 2]
    det = np.sum(a2 * np.cross(a3, a4), axis=-1)[..., None]
    dual_2, dual_3 = np.cross(a3, a4) / det, np.cross(a4, a2) / det
    swing_2, swing_3 = np.cross(a2, offset), np.cross(a3, step_3)

    def moved(rho: Array) -> Array:
        """Change of the offset when the upper link turns by rho against the lower."""
        turn_2 = np.sum(dual_2 * rho, axis=-1)[..., None]
        turn_3 = np.sum(dual_3 * rho, axis=-1)[..., None]
        return np.asarray(turn_2 * swing_2 + turn_3 * swing_3)

    by_pose = np.zeros((*gap.shape, 6))
    by_pose[..., :3] = np.eye(3)
    for k in range(3):
        unit = np.broadcast_to(np.eye(3)[k], gap.shape)
        by_pose[..., 3 + k] = np.cross(unit, arm + back) - moved(unit)
    first = np.broadcast_to(axis_1, gap.shape)
    by_bottom = -np.cross(first, s_arm + offset) + moved(first)
    by_top = -np.cross(axis_5, back) + moved(axis_5)
    free = np.cross(np.cross(first, s_arm), np.cross(axis_5, back))
    free = free / np.linalg.norm(free, axis=-1)[..., None]
    rod, rod_by_pose = _rod(g, grown, position, rotation)
    return Gaps(gap, by_pose, by_bottom, by_top, free, rod, rod_by_pose)


def _across(vector: Array, axis: Array) -> Array:
    """Unit vectors (N, 3) of ``vector`` without its part along the unit ``axis``."""
    flat = vector - np.sum(vector * axis, axis=-1)[:, None] * axis
    return np.asarray(flat / np.linalg.norm(flat, axis=-1)[:, None])


def _rod(g: PtmGeometry, grown: Array, position: Array, rotation: Array) -> tuple[Array, Array]:
    """Stretch of the rod (N,) and its derivative by the pose (N, 6).

    Each end has two axes that miss each other by a small arm; the arm points along the rod as seen
    along the first axis (x of base and of platform), so the rod is perpendicular to the second
    axis and the arm's turn does not change its length.
    """
    first_base = np.broadcast_to(np.array([1.0, 0.0, 0.0]), position.shape)
    first_top = rotation[:, :, 0]
    top = position + rotation @ g.rod_top
    vector = top - g.rod_base
    for _ in range(3):
        start = g.rod_base - g.rod_arms[0] * _across(vector, first_base)
        end = top - g.rod_arms[1] * _across(vector, first_top)
        vector = end - start
    length = np.linalg.norm(vector, axis=-1)
    u = vector / length[:, None]
    rows = np.concatenate([u, np.cross(end - position, u)], axis=1)
    return length - g.rod_length * grown, rows
