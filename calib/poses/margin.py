"""Room that a machine within tolerance needs at its limits beyond the drawing's.

Poses are chosen with nominal parameters. Once a machine is calibrated, other actuator coordinates
and other joint angles belong to the same poses: one that the drawing allows to the last 0.1 mm is
then refused.
"""

from functools import lru_cache

import numpy as np

from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.mechanism.solve import inverse
from calib.poses.reach import PoseSet, sample_poses

SAMPLES, SEED = 40, 2
"""Reachable poses at which the room is worked out, always the same; the largest counts."""
SIGMAS = 4.0
"""Standard deviations that are kept, where all tolerances at their ends would need more."""
MOST = 0.15
"""Largest part of a range that is kept at each end: poses must remain to be chosen."""


@lru_cache(maxsize=64)
def tolerance_margin(machine: Machine) -> Margin:
    """How much actuator coordinates and joints change over the tolerances, the pose being held.

    With c_j the change when parameter j goes to the end of its tolerance (differences, the larger
    of both ends): the smaller of sum |c_j|, every parameter at its worst end, and of four standard
    deviations, 4 sqrt(sum c_j^2 / 3), as tolerances are half-widths of uniform distributions. The
    largest over 40 reachable poses counts, and for an actuator the larger of two: its coordinate
    by the controller's own reference, and by the drawing's, which a host keeps.

    Raises
    ------
    BadInput
        If the workspace box holds hardly any reachable pose.
    """
    poses = sample_poses(machine, SAMPLES, np.random.default_rng(SEED))
    changes = [_changes(machine, poses, end) for end in (1.0, -1.0)]
    by_own, by_drawing, joints = (
        _needed(np.maximum(*(np.abs(one) for one in both))) for both in zip(*changes, strict=True)
    )
    limits = np.array([joint.limits for joint in machine.joints]).reshape(-1, 2)
    return Margin(
        _at_most(np.maximum(by_own, by_drawing), machine.q_limits), _at_most(joints, limits)
    )


def stroke_margin(machine: Machine, more_mm: float) -> Margin:
    """The room of :func:`tolerance_margin`, and ``more_mm`` at the ends of every linear stroke."""
    strokes = np.array([actuator.unit == "mm" for actuator in machine.actuators])
    return tolerance_margin(machine).widened(more_mm * strokes)


def _changes(machine: Machine, poses: PoseSet, end: float) -> tuple[Array, Array, Array]:
    """Changes (m, P, N) of q by the controller's reference, by the drawing's, and of the joints."""
    count, free = poses.count, len(machine.parameters)
    off = np.repeat(np.diag(end * machine.tolerance), count, axis=1)
    start = poses.configuration.take(np.tile(np.arange(count), free))
    found = inverse(machine, np.tile(poses.task, (1, free)), machine.nominal[:, None] + off, start)
    places = np.array(
        [
            machine.index(a.reference) if isinstance(a.reference, str) else free
            for a in machine.actuators
        ]
    )
    reference = np.vstack([off, np.zeros((1, off.shape[1]))])[places]
    s = found.extension - start.extension
    joints = found.passive - start.passive

    def by_parameter(change: Array) -> Array:
        # A pose at which a machine at its tolerance's end does not close is not one to learn from.
        kept = np.where(found.converged, change, 0.0)
        return kept.reshape(len(change), free, count)

    return by_parameter(s + reference), by_parameter(s), by_parameter(joints)


def _needed(changes: Array) -> Array:
    """Room (m,) of sizes (m, P, N)."""
    worst = changes.sum(axis=1)
    spread = SIGMAS * np.sqrt((changes**2).sum(axis=1) / 3.0)
    return np.asarray(np.minimum(worst, spread).max(axis=1, initial=0.0))


def _at_most(needed: Array, limits: Array) -> Array:
    return np.minimum(needed, MOST * (limits[:, 1] - limits[:, 0]))
