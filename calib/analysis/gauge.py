"""Gauge freedoms: rigid motions of the base and of the platform that the parameters can undo.

Where the base frame and the nests are not known, moving the base frame by a twist and moving all
joints on the base back leaves every reading as it is; so on the platform. Twelve such motions
exist. What the parameters cannot undo of one is its *visible* part: the sine of the angle between
its effect and all that the parameters can do, 0 for an exact gauge freedom. Freedoms that only
small offsets break are visible to a fraction of a percent: free in practice.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.mechanism.jacobian import pose_jacobians
from calib.poses.information import frame_columns
from calib.poses.reach import PoseSet

EXACT = 1e-9
WEAK = 0.02
"""Visible part below which a motion is free in practice."""
MOTIONS = ("along x", "along y", "along z", "about x", "about y", "about z")


@dataclass(frozen=True)
class Motion:
    """A rigid motion of the ``body`` and what is visible of it when taken alone (0 .. 1)."""

    body: str
    motion: str
    visible: float

    @property
    def verdict(self) -> str:
        """``hidden``, ``nearly hidden`` or ``visible``."""
        return "hidden" if self.visible < EXACT else _weak(self.visible)


def _weak(visible: float) -> str:
    return "nearly hidden" if visible < WEAK else "visible"


@dataclass(frozen=True, eq=False)
class Gauges:
    """The twelve motions one by one, and how many independent ones are exact and weak.

    ``visible`` (12,): visible parts of the best combinations, largest first. ``alike``: motions
    of base and platform that no reading tells apart, whatever the parameters (a machine that
    never turns: its tool offset is its frame's origin).
    """

    motions: tuple[Motion, ...]
    visible: Array
    alike: tuple[tuple[str, str], ...]

    @property
    def exact(self) -> int:
        """Number of exact gauge freedoms."""
        return int(np.sum(self.visible < EXACT))

    @property
    def weak(self) -> int:
        """Number of further gauge freedoms that are nearly invisible."""
        return int(np.sum(self.visible < WEAK)) - self.exact


def gauges(poses: PoseSet, lever: float) -> Gauges:
    """Which rigid motions the machine's parameters can undo, judged over poses.

    Parameters
    ----------
    poses : PoseSet
    lever : float
        Distance in mm at which a turn counts as a displacement (the radius of the nests).
    """
    machine = poses.machine
    weight = np.array([1.0, 1.0, 1.0, lever, lever, lever])[:, None]
    J = pose_jacobians(machine, poses.configuration).parameters
    able = _flat(J * machine.prior_sigma[:, None, None] * weight)
    able = able / np.maximum(np.linalg.norm(able, axis=0), 1e-300)
    U, values, _ = np.linalg.svd(able, full_matrices=False)
    U = U[:, values > 1e-12 * values[0]]
    R = poses.poses.rotation
    carried = np.zeros((6, 6, poses.count))
    for axis in range(3):
        carried[axis, :3] = R[:, axis]
        carried[3 + axis, 3:] = R[:, axis]
    motions = np.hstack([_flat(frame_columns(poses.poses) * weight), _flat(carried * weight)])
    motions = motions / np.linalg.norm(motions, axis=0)
    alone = np.linalg.norm(_rest(motions, U), axis=0)
    span, sizes, _ = np.linalg.svd(motions, full_matrices=False)
    span = span[:, sizes > EXACT * sizes[0]]
    combined = np.zeros(len(sizes))
    combined[: span.shape[1]] = np.linalg.svd(_rest(span, U), compute_uv=False)
    named = [(body, motion) for body in ("base", "platform") for motion in MOTIONS]
    cosines = motions.T @ motions
    alike = tuple(
        (" ".join(named[i]), " ".join(named[j]))
        for i in range(6)
        for j in range(6, 12)
        if abs(cosines[i, j]) > 1.0 - EXACT
    )
    return Gauges(
        tuple(Motion(b, m, float(v)) for (b, m), v in zip(named, alone, strict=True)),
        combined,
        alike,
    )


def _flat(columns: Array) -> Array:
    """(k, 6, N) -> (6 N, k)."""
    return columns.reshape(len(columns), -1).T


def _rest(B: Array, U: Array) -> Array:
    """What is left of B outside the span of U; twice, against rounding."""
    rest: Array = B - U @ (U.T @ B)
    return rest - U @ (U.T @ rest)
