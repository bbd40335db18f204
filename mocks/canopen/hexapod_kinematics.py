"""The hexapod controller's own inverse kinematics, in closed form (Han et al. 2020).

Limb i, joint frames FB = Rz(phi_b) and FP = Rz(phi_p)::

    C = B + LB n_B,   n_B = y_B cos(psi_B) + z_B sin(psi_B)     psi_B in (0, pi)
    D = t + R (P + LP n_P),   n_P = y_P cos(psi_P) + z_P sin(psi_P)     psi_P in (-pi, 0)
    v = D - C = l u,   u . (x_B x n_B) = 0,   u . R (x_P x n_P) = 0

Since x_B x n_B is perpendicular to n_B, the first condition says (D - B) . (x_B x n_B) = 0, that
is tan(psi_B) = z/y of D - B in FB; likewise tan(psi_P) = z/y of R^T (C - t) - P in FP. The two are
solved in turn at every pose; each pass gains a factor of about (LB/l)(LP/l) = 1/2000.
"""

import math
from collections.abc import Mapping, Sequence

from mocks.canopen.unreachable import Unreachable

PHI_B = tuple(math.radians(a) for a in (15.0, 105.0, 135.0, 225.0, 255.0, 345.0))
PHI_P = tuple(math.radians(a) for a in (45.0, 75.0, 165.0, 195.0, 285.0, 315.0))
PARAMETERS = ("B_x", "B_y", "B_z", "P_x", "P_y", "P_z", "L0", "L_B", "L_P")
PASSES = 40

Vector = tuple[float, float, float]
Turn = tuple[Vector, Vector, Vector]
"""Rows of a rotation matrix."""


def rotation(alpha: float, beta: float, gamma: float) -> Turn:
    """Return the rows of R = Rz(gamma) Ry(beta) Rx(alpha)."""
    ca, sa = math.cos(alpha), math.sin(alpha)
    cb, sb = math.cos(beta), math.sin(beta)
    cg, sg = math.cos(gamma), math.sin(gamma)
    return (
        (cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa),
        (sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa),
        (-sb, cb * sa, cb * ca),
    )


def leg_length(
    position: Vector, rows: Turn, leg: int, values: Mapping[str, float] | Sequence[float]
) -> float:
    """Return the length C to D of one leg in mm.

    Parameters
    ----------
    position : (3,) mm, base frame
    rows : rows of the platform's rotation matrix
    leg : 0..5, selects phi_b and phi_p
    values : B_x, B_y, B_z, P_x, P_y, P_z, L0, L_B, L_P in this order, or by name

    Raises
    ------
    Unreachable
        The iteration does not settle, as when an arm has nothing to point at.
    """
    if isinstance(values, Mapping):
        values = [values[name] for name in PARAMETERS]
    bx, by, bz, px, py, pz, _, arm_b, arm_p = values
    cos_b, sin_b = math.cos(PHI_B[leg]), math.sin(PHI_B[leg])
    cos_p, sin_p = math.cos(PHI_P[leg]), math.sin(PHI_P[leg])
    tx, ty, tz = position
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = rows
    psi_b, psi_p = 0.5 * math.pi, -0.5 * math.pi
    for _ in range(PASSES):
        along, up = arm_p * math.cos(psi_p), arm_p * math.sin(psi_p)
        x, y, z = px - sin_p * along, py + cos_p * along, pz + up
        dx = tx + r00 * x + r01 * y + r02 * z
        dy = ty + r10 * x + r11 * y + r12 * z
        dz = tz + r20 * x + r21 * y + r22 * z
        new_b = math.atan2(dz - bz, -sin_b * (dx - bx) + cos_b * (dy - by))
        along, up = arm_b * math.cos(new_b), arm_b * math.sin(new_b)
        cx, cy, cz = bx - sin_b * along, by + cos_b * along, bz + up
        wx, wy, wz = cx - tx, cy - ty, cz - tz
        x = r00 * wx + r10 * wy + r20 * wz - px
        y = r01 * wx + r11 * wy + r21 * wz - py
        z = r02 * wx + r12 * wy + r22 * wz - pz
        new_p = math.atan2(z, -sin_p * x + cos_p * y)
        settled = abs(new_b - psi_b) + abs(new_p - psi_p) < 1e-15
        psi_b, psi_p = new_b, new_p
        if settled:
            break
    else:
        # Rounding may keep the last bit of an angle moving; anything larger is no solution.
        if not (math.isfinite(psi_b) and math.isfinite(psi_p)):
            raise Unreachable(leg)
    if not (0.0 < psi_b < math.pi and -math.pi < psi_p < 0.0):
        raise Unreachable(leg)
    return math.dist((dx, dy, dz), (cx, cy, cz))


def leg_lengths(pose: Sequence[float], parameters: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Return the six leg lengths q in mm at ``pose`` = x, y, z (mm), alpha, beta, gamma (rad).

    ``parameters`` holds nine values a leg in the order of :data:`PARAMETERS`.
    """
    x, y, z, alpha, beta, gamma = pose
    rows = rotation(alpha, beta, gamma)
    return tuple(leg_length((x, y, z), rows, leg, own) for leg, own in enumerate(parameters))


class HexapodKinematics:
    """The hexapod's part of a controller: what its limbs are called and how a pose becomes q."""

    limbs: tuple[str, ...] = tuple(f"leg{n}" for n in range(1, 7))

    def reference(self, n: int, active: Mapping[str, float]) -> float:
        """q of actuator ``n`` (from 0) at extension 0: the L0 that the controller holds."""
        return active[f"{self.limbs[n]}.L0"]

    def targets(self, pose: Sequence[float], active: Mapping[str, float]) -> list[float]:
        """q of all actuators at ``pose`` with the parameters ``active``; raises Unreachable."""
        own = [[active[f"{limb}.{name}"] for name in PARAMETERS] for limb in self.limbs]
        return list(leg_lengths(pose, own))
