"""Legs grow with the structure's temperature: extension_i = a (T - 20 deg C) l_i."""

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown
from calib.mechanism.description import Machine
from calib.runs.stack import Rows

REFERENCE_C = 20.0


class ThermalGrowth(Effect):
    """One expansion coefficient for all legs; for machines whose actuators are the legs."""

    id = "thermal-growth"
    kind = "machine"
    says = "the legs grow with the temperature of the structure"
    channels = ("structure_temp_C",)
    depends = ("structure_temp_C",)

    def applies(self, machine: Machine) -> bool:
        """Where q is the length of a leg (tripod and ptm have definitions of their own)."""
        return bool(machine.actuators) and all(
            a.unit == "mm" and isinstance(a.reference, str) for a in machine.actuators
        )

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``thermal-growth.a``, 1/K."""
        return (Unknown("thermal-growth.a", "1/K", 1e-5),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Length times warming."""
        warming = situation.rows.channels["structure_temp_C"] - REFERENCE_C
        return Signature(extension=(warming * situation.length)[None])


EFFECTS = (ThermalGrowth(),)
