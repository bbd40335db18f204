"""Lost motion: extension_i = -b_i/2 times the sign of the leg's last change."""

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.runs.stack import Rows
from calib.unknown import Unknown


class Backlash(Effect):
    """One lost motion for each actuator; zero before the actuator's first move."""

    id = "backlash"
    kind = "machine"
    says = "a leg loses motion when it turns round: play in nut, bearing or gear"
    depends = ("direction",)
    wrong_sign = "the rows stand in another order than they were measured in, or q counts backwards"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``backlash.leg1`` ..., mm or rad."""
        return tuple(
            Unknown(f"backlash.{axis.name}", axis.unit, axis.lost_motion)
            for axis in rows.machine.axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Half a step against the direction of approach."""
        return Signature(extension=per_actuator(-0.5 * situation.rows.direction))


EFFECTS = (Backlash(),)
