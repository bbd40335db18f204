"""Each leg, screw or drive warms by itself: extension_i = e_i (T - 20 deg C).

T is the structure's temperature: e_i holds how much of its change the leg takes part in, one in
the sun or beside a fan more than another. A leg grows in proportion to its length as it is
extended (e_i at home); what all legs share is ``thermal-growth``.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.effects.limb_frames import nominal_value
from calib.effects.thermal_growth import REFERENCE_C
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.unknown import Unknown

KELVINS = 5.0
"""Warming by which the usual error is reached."""


class LegWarming(Effect):
    """One growth for each actuator."""

    id = "leg-warming"
    kind = "machine"
    says = "legs or drives warm one more than another (sun, fan, a warm side of the machine)"
    channels = ("structure_temp_C",)
    depends = ("structure_temp_C",)
    wrong_size = "structure_temp_C is not in deg C"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``leg-warming.leg1`` ..., mm/K or rad/K."""
        return tuple(
            Unknown(f"leg-warming.{axis.name}", f"{axis.unit}/K", axis.usual_error / KELVINS)
            for axis in rows.machine.axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Warming, times the length over that at home where a leg is extended."""
        rows = situation.rows
        warming = rows.channels["structure_temp_C"] - REFERENCE_C
        return Signature(extension=per_actuator(warming * _stretched(rows)))


def _stretched(rows: Rows) -> Array:
    """Length of each leg over its length at home (n, N); 1 for what is no leg."""
    machine = rows.machine
    home = _lengths_at_home(machine)
    longer = rows.extension / np.where(home > 0.0, home, 1.0)[:, None]
    return np.where(home[:, None] > 0.0, 1.0 + longer, 1.0)


def _lengths_at_home(machine: Machine) -> Array:
    """Length (n,) of the translation that each actuator extends as a leg; 0 where it is none."""
    home = np.zeros(len(machine.actuators))
    for limb in machine.limbs:
        for element in limb.traits.grows:
            for term in limb.elements[element].terms:
                if term.kind == "actuator":
                    home[term.index] = abs(nominal_value(machine, limb, element) / term.factor)
    return home


EFFECTS = (LegWarming(),)
