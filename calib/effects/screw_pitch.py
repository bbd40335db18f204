"""Every screw has its own gain: extension_i = g_i s_i."""

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.runs.stack import Rows
from calib.unknown import Unknown


class ScrewPitch(Effect):
    """One relative gain for each actuator."""

    id = "screw-pitch"
    kind = "machine"
    says = "each screw has its own gain: its real lead differs from the drawing's"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``screw-pitch.leg1`` ..., a ratio."""
        return tuple(Unknown(f"screw-pitch.{axis.name}", "1", 1e-3) for axis in rows.machine.axes)

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Commanded extension."""
        return Signature(extension=per_actuator(situation.rows.extension))


EFFECTS = (ScrewPitch(),)
