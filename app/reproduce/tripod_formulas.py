"""Closed forms of the tripod, as Feng et al. (2022) meant them (misprints: docs/reproduction.md).

o_i = (cos th_i, sin th_i, 0); A_i = l_i o_i; B_i = r + b o_i; w_i = (B_i - A_i) / h. The paper's
errors of one limb, in the order of :data:`SOURCES`: e1 (3, limb axes), e2, h1, h2, e3 (3, limb
axes), theta_A (3, base axes), theta_B (3, base axes).
"""

import numpy as np

from calib.arrays import Array

B, H, C = 180.0, 260.0, 150.0
AZIMUTH = np.radians([0.0, 120.0, 240.0])
SOURCES = (
    "de1x", "de1y", "de1z", "de2", "dh1", "dh2", "de3x", "de3y", "de3z",
    "dtheta_Ax", "dtheta_Ay", "dtheta_Az", "dtheta_Bx", "dtheta_By", "dtheta_Bz",
)  # fmt: skip


def slider(r: Array) -> Array:
    """Equation (3): slider places l (3, N) in mm for platform positions r (3, N)."""
    cos, sin = np.cos(AZIMUTH)[:, None], np.sin(AZIMUTH)[:, None]
    t = r[0] * sin - r[1] * cos
    l: Array = B + r[0] * cos + r[1] * sin + np.sqrt(H**2 - r[2] ** 2 - t**2)  # noqa: E741
    return l


def limb(i: int, r: Array) -> tuple[float, Array, Array, Array]:
    """l_i, o_i, w_i and the rotation R_i of limb i at the platform position r (3,)."""
    length = float(slider(r[:, None])[i, 0])
    cos, sin = np.cos(AZIMUTH[i]), np.sin(AZIMUTH[i])
    R = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    o = R[:, 0]
    return length, o, (r + B * o - length * o) / H, R


def side_row(i: int, j: int, r: Array) -> tuple[Array, Array]:
    """Equation (6) for long side j = 0, 1: row (6,) for [dr; dtheta] and the errors' row (15,)."""
    length, o, w, R = limb(i, r)
    sign = -0.5 if j == 0 else 0.5
    at_a = np.cross((length + sign * C) * o, w)
    at_b = np.cross((B + sign * C) * o, w)
    errors = np.concatenate([
        w @ R, [sign * (w @ o)], np.eye(2)[j], sign * C * np.cross(o, w) @ R, at_a, -at_b
    ])  # fmt: skip
    return np.concatenate([w, at_b]), errors


def hinge_row(i: int, r: Array, plain: bool) -> tuple[Array, Array]:
    """The hinges keep the lower short side in its plane: row (6,) and the errors' row (15,).

    The couple stands perpendicular to the slider's axis in the plane of the parallelogram; of unit
    length if ``plain``, else as long as o x w (the stiffness then goes with its square).
    """
    _, o, w, R = limb(i, r)
    couple = np.cross(o, np.cross(o, w))
    if plain:
        couple = couple / np.linalg.norm(couple)
    errors = np.concatenate([np.zeros(6), couple @ R, couple, -couple])
    return np.concatenate([np.zeros(3), couple]), errors


def elastic_map(r: Array, kappa: float, plain: bool = True) -> Array:
    """Twist (6, 45) of the platform per error of the three limbs, closed by elastic averaging.

    ``kappa`` = k_hinge / (k_side c^2).
    """
    rows, errors = np.zeros((9, 6)), np.zeros((9, 45))
    for i in range(3):
        part = slice(15 * i, 15 * i + 15)
        for j in range(2):
            rows[3 * i + j], errors[3 * i + j, part] = side_row(i, j, r)
        row, sources = hinge_row(i, r, plain)
        rows[3 * i + 2] = np.sqrt(kappa) * C * row
        errors[3 * i + 2, part] = np.sqrt(kappa) * C * sources
    return np.asarray(np.linalg.lstsq(rows, errors, rcond=1e-14)[0], dtype=float)
