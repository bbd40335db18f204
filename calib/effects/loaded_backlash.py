"""Lost motion that grows with load: extension_i = -k_i/2 |F_i| sign(last change of s_i).

Friction in nut, guide and joint holds an actuator back in proportion to what it carries. The
forces F_i are those of ``leg-compliance``.
"""

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.effects.gravity_sag import actuator_forces, spring_compliance, under_load, weightless
from calib.effects.leg_compliance import loaded
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.unknown import Unknown


class LoadedBacklash(Effect):
    """One lost motion per force for each actuator."""

    id = "loaded-backlash"
    kind = "machine"
    says = "legs or drives lose motion when they turn round, the more the more they carry: friction"
    depends = ("run", "direction", "payload_kg")
    wrong_sign = "the rows stand in another order than they were measured in, or q counts backwards"

    def lacking(self, machine: Machine) -> str:
        """What an actuator carries must be known."""
        rods = spring_compliance(machine) > 0.0
        return "its rods share the load by their springs (trait yields)" if rods else ""

    def unavailable(self, rows: Rows) -> str:
        """Without a weight, or where none of it rests on an actuator."""
        return weightless(rows) or ("" if loaded(rows).size else "no actuator carries the weight")

    def told(self, rows: Rows) -> BoolArray:
        """Those of runs with [load]."""
        return under_load(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``loaded-backlash.leg1`` ..., mm/N or rad/(N mm)."""
        axes = [rows.machine.axes[index] for index in loaded(rows)]
        return tuple(
            Unknown(f"loaded-backlash.{axis.name}", axis.compliance_unit, axis.compliance)
            for axis in axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(loaded(rows).size)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Half a step against the direction of approach, times the load."""
        rows = situation.rows
        shape = per_actuator(-0.5 * np.abs(actuator_forces(situation)) * rows.direction)
        return Signature(extension=shape[loaded(rows)])


EFFECTS = (LoadedBacklash(),)
