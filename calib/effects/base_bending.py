"""What the machine stands on gives way: it sinks and leans under platform and payload.

    the machine moves by  s F  and turns about the base origin by  c M_h

F is the weight, M_h what of its moment about the base origin lies across it; the base nests stand
elsewhere and do not.
"""

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Signature, Situation
from calib.effects.gravity_sag import WEIGHT_UPWARDS, under_load, weight_wrench, weightless
from calib.mechanism.rigid import cross
from calib.runs.stack import Rows
from calib.unknown import Unknown


class BaseBending(Effect):
    """One compliance against leaning, one against sinking."""

    id = "base-bending"
    kind = "machine"
    says = "base or stand give way under the weight: the machine leans and sinks with its load"
    depends = ("run", "payload_kg")
    wrong_sign = WEIGHT_UPWARDS
    wrong_size = "payload_kg, or a mass in [load], is not in kg (payload in grams?)"

    def unavailable(self, rows: Rows) -> str:
        """Without a weight."""
        return weightless(rows)

    def told(self, rows: Rows) -> BoolArray:
        """Those of runs with [load]."""
        return under_load(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``base-bending.lean``, rad/(N mm); ``.sink``, mm/N."""
        return (
            Unknown("base-bending.lean", "rad/(N mm)", 1e-8),
            Unknown("base-bending.sink", "mm/N", 1e-4),
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Either alone."""
        return ((0,), (1,))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """A rigid motion of the whole machine."""
        force, moment = weight_wrench(situation.rows, situation.rotation)
        about_base = moment + cross(situation.position, force)
        size = np.linalg.norm(force, axis=0)
        down = force / np.where(size > 0.0, size, 1.0)
        across = about_base - down * np.sum(down * about_base, axis=0)
        twist = np.zeros((2, 6, situation.rows.count))
        twist[0, :3], twist[0, 3:] = cross(across, situation.position), across
        twist[1, :3] = force
        return Signature(twist=twist)


EFFECTS = (BaseBending(),)
