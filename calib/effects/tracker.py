"""What the tracker can get wrong: scale of its ranges, zero of its ranges, a stand that moves."""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.mechanism.rigid import cross
from calib.runs.stack import Rows
from calib.unknown import Unknown


class TrackerScale(Effect):
    """p -> (1 + k) p in the tracker frame."""

    id = "tracker-scale"
    kind = "measurement"
    says = "the tracker scales every range: wrong refractive index (temperature, pressure)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``tracker-scale.k``, a ratio."""
        return (Unknown("tracker-scale.k", "1", 1e-5),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """The point itself."""
        return Signature(point=situation.point[None])


class TrackerOffset(Effect):
    """p -> p + r0 p / |p| in the tracker frame."""

    id = "tracker-offset"
    kind = "measurement"
    says = "the tracker's range zero is off by a constant (birdbath or SMR offset)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``tracker-offset.r0``, mm."""
        return (Unknown("tracker-offset.r0", "mm", 0.01),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Direction of the beam."""
        ranges = np.sqrt(np.sum(situation.point**2, axis=0))
        return Signature(point=(situation.point / ranges)[None])


class TrackerDrift(Effect):
    """p -> p + u (v + w x p), u from 0 to 1 over the run; every run has its own drift."""

    id = "tracker-drift"
    kind = "measurement"
    says = "the tracker's stand moves slowly during the run"

    @property
    def of_its_run(self) -> bool:
        """It may stand still in the next, or move another way."""
        return True

    def unavailable(self, rows: Rows) -> str:
        """Time must pass."""
        return "" if np.ptp(rows.progress) > 0 else "all readings have the same time"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``tracker-drift.vx`` .. ``.wz``, mm and rad over the run; with several runs numbered."""
        return tuple(
            Unknown(
                f"tracker-drift.{run_prefix(rows, run)}{motion}{axis}",
                "mm" if motion == "v" else "rad",
                0.02 if motion == "v" else 1e-5,
            )
            for run in range(len(rows.runs))
            for motion in "vw"
            for axis in "xyz"
        )

    def signature(self, situation: Situation, values: Array) -> Signature:
        """A rigid motion that grows in proportion to time."""
        rows = situation.rows
        shape = np.zeros((6 * len(rows.runs), 3, rows.count))
        for run in range(len(rows.runs)):
            share = rows.progress * (rows.run == run)
            shape[6 * run : 6 * run + 6] = share * rigid_motions(situation.point)
        return Signature(point=shape)


def rigid_motions(point: Array) -> Array:
    """Displacements (6, 3, N) of points (3, N) by unit translations and rotations."""
    motions = np.zeros((6, *point.shape))
    for axis in range(3):
        motions[axis, axis] = 1.0
        motions[3 + axis] = cross(np.eye(3)[axis][:, None], point)
    return motions


def run_prefix(rows: Rows, run: int) -> str:
    """Number the runs in names, where there are several."""
    return f"run{run + 1}." if len(rows.runs) > 1 else ""


EFFECTS = (TrackerScale(), TrackerOffset(), TrackerDrift())
