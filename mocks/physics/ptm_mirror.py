"""The tracking mechanism without errors, in closed form: the platform is the base's mirror image.

Mirror plane: n . x = H / 2 with n = [sin(t/2) cos f, sin(t/2) sin f, cos(t/2)] for the tilt t and
the azimuth f of the platform's z axis; C_E = H n and R = (1 - 2 n n^T) diag(1, 1, -1). A lower
link whose limb points to d rises at e from the horizontal, and its S joint lies in the plane::

    (a + L cos e) d . n + L sin e n_z = H / 2

mm and rad.
"""

import numpy as np

from mocks.physics.pose import Array, Pose
from mocks.physics.ptm import LINK, RADIUS, ROD
from mocks.physics.ptm_closure import Stance

HOME_RISE = float(np.arcsin(0.5 * ROD / LINK))
TOP_AT_HOME = float(np.radians(90.0 - 22.1) - np.arccos(0.5 * ROD / LINK))
DIRECTIONS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


def normals(tilt: Array, azimuth: Array) -> Array:
    """Normals n (N, 3) of the mirror plane for tilts and azimuths (N,)."""
    half = 0.5 * tilt
    flat = np.sin(half)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(half)], axis=1)


def base_angles(n: Array) -> Array:
    """Angles of the four base joints from home (outward positive), (N, 4); NaN out of reach."""
    out, up = n[:, :2] @ DIRECTIONS.T, n[:, 2:]
    share = (0.5 * ROD - RADIUS * out) / (LINK * np.hypot(out, up))
    inside = np.where(np.abs(share) <= 1.0, share, np.nan)
    return np.asarray(HOME_RISE - np.arctan2(up, out) + np.arccos(inside))


def normals_of_motors(q: Array) -> Array:
    """Normals (N, 3) for the angles of both motors (N, 2); raises ArithmeticError out of reach.

    Two planes through the S joints of the motors' links and |n| = 1 are a quadratic in n_z.
    """
    rise = HOME_RISE - q
    reach = RADIUS + LINK * np.cos(rise)
    a, b = 0.5 * ROD / reach, LINK * np.sin(rise) / reach
    square, half = 1.0 + np.sum(b**2, axis=1), np.sum(a * b, axis=1)
    under = half**2 - square * (np.sum(a**2, axis=1) - 1.0)
    if not np.all(under >= 0.0):
        raise ArithmeticError("the limbs do not close")
    up = (half + np.sqrt(under)) / square
    return np.column_stack([a - b * up[:, None], up])


def stance(q: Array) -> Stance:
    """The whole mechanism for motor angles (N, 2); raises ArithmeticError out of reach."""
    n = normals_of_motors(q)
    bottom = base_angles(n)
    if not np.isfinite(bottom).all():
        raise ArithmeticError("the limbs do not close")
    mirror = np.eye(3) - 2.0 * n[:, :, None] * n[:, None, :]
    pose = Pose(ROD * n, mirror * np.array([1.0, 1.0, -1.0]))
    return Stance(pose, bottom[:, 2:], TOP_AT_HOME - bottom, np.zeros((len(q), 6, 2)))
