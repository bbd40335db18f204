"""Effects of the tripod, through its elastic closure (Feng et al. 2022; notes.md section 2).

Every effect moves the platform by the twists of error sources that the machine file describes in
detail: the twist per unit of a rod's length is, by Betti's reciprocity, also the force in that rod
per unit wrench on the platform, so gravity needs no statics of its own.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown, alone, limb_names
from calib.effects.gravity_sag import GravitySag, weight_wrench
from calib.effects.thermal_growth import REFERENCE_C, ThermalGrowth
from calib.mechanism.description import Machine
from calib.runs.stack import Rows

SIDES = ("dh1", "dh2")


def has_parallelograms(machine: Machine) -> bool:
    """Tell whether the limbs are parallelograms with two long sides of their own."""
    detailed = machine.detailed or machine
    names = {parameter.name for parameter in detailed.parameters}
    wanted = (*SIDES, "dtheta_Bz", "h")
    return all(f"{limb}.{part}" in names for limb in limb_names(machine) for part in wanted)


class TripodGravity(GravitySag):
    """Six rods that are equal springs; the platform may tilt."""

    says = "the six rods give way under the weight of platform and payload"

    def applies(self, machine: Machine) -> bool:
        """Where the limbs are parallelograms."""
        return bool(machine.actuators) and has_parallelograms(machine)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``gravity-sag.c``, mm/N."""
        return (Unknown("gravity-sag.c", "mm/N", 1e-4),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Sum over rods of force times twist per unit of length."""
        force, moment = weight_wrench(situation.rows, situation.rotation)
        wrench = np.concatenate([force, moment])
        total = np.zeros((6, situation.rows.count))
        for limb in limb_names(situation.machine):
            for side in SIDES:
                twist = situation.error_twists(f"{limb}.{side}")
                total += np.sum(wrench * twist, axis=0) * twist
        return Signature(twist=total[None])


class TripodThermal(ThermalGrowth):
    """Rods grow; base and platform do not."""

    says = "the rods grow with the temperature of the structure"

    def applies(self, machine: Machine) -> bool:
        """Where the limbs are parallelograms."""
        return bool(machine.actuators) and has_parallelograms(machine)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Both long sides of every limb, h (T - 20 deg C) each."""
        machine = situation.machine
        warming = situation.rows.channels["structure_temp_C"] - REFERENCE_C
        total = np.zeros((6, situation.rows.count))
        for limb in limb_names(machine):
            length = machine.nominal[machine.index(f"{limb}.h")]
            total += length * warming * situation.error_twists(f"{limb}.h")
        return Signature(twist=total[None])


class ParallelogramSides(Effect):
    """Difference of the two long sides, one for each limb."""

    id = "parallelogram-sides"
    kind = "machine"
    says = "the two long sides of a parallelogram differ, and the platform turns"

    def applies(self, machine: Machine) -> bool:
        """Where the limbs are parallelograms."""
        return bool(machine.actuators) and has_parallelograms(machine)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``parallelogram-sides.limb1`` ..., mm: side 1 less side 2."""
        return tuple(
            Unknown(f"parallelogram-sides.{name}", "mm", 0.05) for name in limb_names(rows.machine)
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each limb alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Half a difference longer on one side, half shorter on the other."""
        return Signature(
            twist=np.array(
                [
                    0.5 * situation.error_twists(f"{limb}.dh1")
                    - 0.5 * situation.error_twists(f"{limb}.dh2")
                    for limb in limb_names(situation.machine)
                ]
            )
        )


class JointAzimuth(Effect):
    """Azimuth of the platform joint less that of the slider, one for each limb."""

    id = "joint-azimuth"
    kind = "machine"
    says = "a platform joint's azimuth differs from its slider's"

    def applies(self, machine: Machine) -> bool:
        """Where the limbs are parallelograms."""
        return bool(machine.actuators) and has_parallelograms(machine)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-azimuth.limb1`` ..., rad."""
        return tuple(
            Unknown(f"joint-azimuth.{name}", "rad", 1e-3) for name in limb_names(rows.machine)
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each limb alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Turn of the joint's frame on the platform."""
        return Signature(
            twist=np.array(
                [
                    situation.error_twists(f"{limb}.dtheta_Bz")
                    for limb in limb_names(situation.machine)
                ]
            )
        )


EFFECTS = (TripodGravity(), TripodThermal(), ParallelogramSides(), JointAzimuth())
