"""How the tracking mechanism closes: equal springs at its S joints take up what does not fit.

Seven constraints hold six freedoms. The mechanism rests where the sum of the squares of the four
gaps and of the rod's stretch is smallest: Gauss-Newton over platform pose, four platform joints and
the two base joints that no motor turns, 12 unknowns and 13 equations. mm and rad.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mocks.physics.pose import Array, Pose, rotation_from_vector
from mocks.physics.ptm import DRIVEN, LINK, ROD, PtmGeometry, gaps

MOST_STEPS = 30
CLOSED = 1e-10
LARGEST_TURN = 0.2
SCALE = np.array([1.0] * 3 + [1.0 / LINK] * 9)


@dataclass(frozen=True)
class Stance:
    """N closed mechanisms: the pose; joint angles from home, rad, of the two base joints without
    motor ``idle`` (N, 2) and of the platform joints ``top`` (N, 4); ``by_motor`` (N, 6, 2): twist
    of the platform for each motor's turn.
    """

    pose: Pose
    idle: Array
    top: Array
    by_motor: Array


def at_home(count: int) -> Stance:
    """``count`` mechanisms at the nominal home pose."""
    pose = Pose(np.tile([0.0, 0.0, ROD], (count, 1)), np.tile(np.eye(3), (count, 1, 1)))
    return Stance(pose, np.zeros((count, 2)), np.zeros((count, 4)), np.zeros((count, 6, 2)))


def close(
    g: PtmGeometry,
    motors: Callable[[Pose, Array], Array],
    grown: Array,
    stiffness: Array,
    start: Stance,
) -> Stance:
    """Close N mechanisms from ``start``.

    Parameters
    ----------
    motors : callable
        (pose, twist by motor (N, 6, 2)) -> angles of the motors from home, (N, 2); they may yield
        a little to the load.
    grown : (N,)
        Factor by which the links have grown.
    stiffness : (4,)
        Of each limb's constraint, 1 = like the others, 0 = released.

    Raises
    ------
    ArithmeticError
        If it does not close.
    """
    now, step = start, np.zeros(())
    for taken in range(MOST_STEPS):
        turned = motors(now.pose, now.by_motor)
        step, by_motor = _step(g, grown, stiffness, now, turned)
        large = np.max(np.abs(step[:, 3:]), axis=1, keepdims=True)
        step = step * np.minimum(1.0, LARGEST_TURN / np.maximum(large, LARGEST_TURN))
        pose = Pose(
            now.pose.position + step[:, :3],
            rotation_from_vector(step[:, 3:6]) @ now.pose.rotation,
        )
        now = Stance(pose, now.idle + step[:, 10:], now.top + step[:, 6:10], by_motor)
        # The first step tells how the motors move the platform: they have not yielded before.
        if taken and float(np.max(np.abs(step / SCALE), initial=0.0)) < CLOSED:
            return now
    raise ArithmeticError(f"the limbs do not close: {np.max(np.abs(step)):.3g} is left")


def _step(
    g: PtmGeometry, grown: Array, stiffness: Array, now: Stance, turned: Array
) -> tuple[Array, Array]:
    """Gauss-Newton step (N, 12), and the platform's twist by each motor (N, 6, 2)."""
    bottom = np.concatenate([turned, now.idle], axis=1)
    found = gaps(g, grown, now.pose.position, now.pose.rotation, bottom, now.top)
    count = len(turned)
    rows, motors = np.zeros((count, 13, 12)), np.zeros((count, 13, DRIVEN))
    residual = np.zeros((count, 13))
    for limb in range(4):
        at = slice(3 * limb, 3 * limb + 3)
        residual[:, at] = found.gap[:, limb]
        rows[:, at, :6] = found.by_pose[:, limb]
        rows[:, at, 6 + limb] = found.by_top[:, limb]
        if limb < DRIVEN:
            motors[:, at, limb] = found.by_bottom[:, limb]
        else:
            rows[:, at, 8 + limb] = found.by_bottom[:, limb]
        if stiffness[limb] != 1.0:
            along = found.free[:, limb]
            less = 1.0 - np.sqrt(stiffness[limb])
            for part in (residual[:, at, None], rows[:, at], motors[:, at]):
                part -= less * along[:, :, None] * np.einsum("ni,nij->nj", along, part)[:, None]
    residual[:, 12], rows[:, 12, :6] = found.rod, found.rod_by_pose
    rows = rows * SCALE
    columns = rows.transpose(0, 2, 1)
    right = columns @ np.concatenate([residual[:, :, None], motors], axis=2)
    solved = -SCALE[:, None] * np.linalg.solve(columns @ rows, right)
    return solved[:, :, 0], solved[:, :6, 1:]
