"""A screw whose lead changes faster towards its ends: extension_i = k_i s_i^3, s_i from home.

Asked beside ``lead-variation`` (s_i^2) or ``screw-pitch`` (s_i), whose next term it is.
"""

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.runs.stack import Rows
from calib.unknown import Unknown

CUBE = {"mm": 3e-7, "rad": 1e-3}
"""Usual size for what slides (1/mm^2: 10 um at 32 mm) and turns (1/rad^2)."""


class LeadCubic(Effect):
    """One number for each actuator."""

    id = "lead-cubic"
    kind = "machine"
    says = "the lead of a screw changes along its length, the faster the farther from home"
    beside = ("lead-variation", "screw-pitch")

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``lead-cubic.leg1`` ..., 1/mm^2 or 1/rad^2."""
        return tuple(
            Unknown(f"lead-cubic.{a.name}", f"1/{a.unit}^2", CUBE[a.moves] * a.ratio**2)
            for a in rows.machine.axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Cube of the commanded extension."""
        return Signature(extension=per_actuator(situation.rows.extension**3))


EFFECTS = (LeadCubic(),)
