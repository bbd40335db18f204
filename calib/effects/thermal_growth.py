"""Legs, rods and links grow with the structure's temperature: a (T - 20 deg C) times their length.

Which translations grow, the machine file says (trait ``grows``). What does not, base and platform
above all, stays as the frames say.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.effects.lengthened import Change, lengthened
from calib.effects.limb_frames import nominal_value
from calib.mechanism.description import Limb, Machine
from calib.runs.stack import Rows
from calib.unknown import Unknown

REFERENCE_C = 20.0


class ThermalGrowth(Effect):
    """One expansion coefficient for everything that grows."""

    id = "thermal-growth"
    kind = "machine"
    says = "legs, rods or links grow with the temperature of the structure"
    channels = ("structure_temp_C",)
    depends = ("structure_temp_C",)
    wrong_sign = "structure_temp_C is of something else, or counts the wrong way round"
    wrong_size = "structure_temp_C is not in deg C"

    def lacking(self, machine: Machine) -> str:
        """Something must grow."""
        if any(limb.traits.grows for limb in machine.limbs):
            return ""
        return "its file names no leg, rod or link that grows (trait grows)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``thermal-growth.a``, 1/K."""
        return (Unknown("thermal-growth.a", "1/K", 1e-5),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Length times warming."""
        warming = situation.rows.channels["structure_temp_C"] - REFERENCE_C
        changes = [
            Change(0, number, element, warming * _length(situation, limb, element))
            for number, limb in enumerate(situation.machine.limbs)
            for element in limb.traits.grows
        ]
        return lengthened(situation, changes, 1)


def _length(situation: Situation, limb: Limb, element: int) -> Array:
    """Nominal value (N,) of a translation, as it is extended at each reading, mm."""
    length = np.full(situation.rows.count, nominal_value(situation.machine, limb, element))
    for term in limb.elements[element].terms:
        if term.kind == "actuator":
            length += term.factor * situation.rows.extension[term.index]
    return length


EFFECTS = (ThermalGrowth(),)
