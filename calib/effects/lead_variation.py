"""A screw whose lead changes along its length: extension_i = k_i s_i^2, s_i from home.

What is proportional to s_i is ``screw-pitch``; what comes back every turn ``screw-cyclic``.
"""

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.mechanism.axes import Axis
from calib.runs.stack import Rows
from calib.unknown import Unknown

CURVATURE = {"mm": 1e-5, "rad": 1e-3}
"""Usual curvature of what slides (1/mm: 10 um at 32 mm) and turns (1/rad)."""


class LeadVariation(Effect):
    """One curvature for each actuator."""

    id = "lead-variation"
    kind = "machine"
    says = "the lead of a screw, or the scale of an encoder, changes along its length"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``lead-variation.leg1`` ..., 1/mm or 1/rad."""
        return tuple(
            Unknown(f"lead-variation.{axis.name}", f"1/{axis.unit}", _usual(axis))
            for axis in rows.machine.axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Square of the commanded extension."""
        return Signature(extension=per_actuator(situation.rows.extension**2))


def _usual(axis: Axis) -> float:
    """Curvature that makes the usual error at an end of the usual way, 1/mm or 1/rad."""
    return CURVATURE[axis.moves] * axis.ratio


EFFECTS = (LeadVariation(),)
