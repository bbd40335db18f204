"""Lost motion that grows with load: extension_i = -k_i/2 |F_i| sign(last change of s_i).

Friction in nut, guide and joint holds an actuator back in proportion to what it carries.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.gravity_sag import spring_compliance
from calib.effects.under_force import PerForce
from calib.mechanism.description import Machine
from calib.runs.stack import Rows


class LoadedBacklash(PerForce):
    """One lost motion per force for each actuator."""

    id = "loaded-backlash"
    says = "legs or drives lose motion when they turn round, the more the more they carry: friction"
    depends = ("run", "direction", "payload_kg")
    wrong_sign = "the rows stand in another order than they were measured in, or q counts backwards"

    def lacking(self, machine: Machine) -> str:
        """What an actuator carries must be known."""
        rods = spring_compliance(machine) > 0.0
        return "its rods share the load by their springs (trait yields)" if rods else ""

    def part(self, rows: Rows, forces: Array) -> Array:
        """Half a step against the direction of approach, times the load."""
        return np.asarray(-0.5 * np.abs(forces) * rows.direction)


EFFECTS = (LoadedBacklash(),)
