"""Effects of the tripod, through its elastic closure (Feng et al. 2022; docs/papers.md).

Effects of geometry move the platform by the twists of error sources that the machine file describes
in detail. Under its weight the platform gives way by the compliance of the closure itself: the long
sides are equal springs, their hinges in the file's proportion to them.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown, alone
from calib.effects.gravity_sag import GravitySag, weight_wrench
from calib.effects.thermal_growth import REFERENCE_C, ThermalGrowth
from calib.mechanism.closure import Closure, Standing
from calib.mechanism.description import Machine
from calib.runs.stack import Rows

SIDES = ("dh1", "dh2")


def has_parallelograms(machine: Machine) -> bool:
    """Tell whether the limbs are parallelograms with two long sides of their own."""
    detailed = machine.detailed or machine
    names = {parameter.name for parameter in detailed.parameters}
    wanted = (*SIDES, "dtheta_Bz", "h")
    return all(f"{axis.name}.{part}" in names for axis in machine.axes for part in wanted)


class TripodGravity(GravitySag):
    """Six long sides that are equal springs; the platform may tilt."""

    says = "the six rods give way under the weight of platform and payload"

    def applies(self, machine: Machine) -> bool:
        """Where the limbs are parallelograms."""
        return bool(machine.actuators) and has_parallelograms(machine)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``gravity-sag.c``, mm/N."""
        return (Unknown("gravity-sag.c", "mm/N", 1e-4),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Platform's compliance times the weight, for long sides of 1 mm/N."""
        machine = situation.machine
        force, moment = weight_wrench(situation.rows, situation.rotation)
        wrench = np.concatenate([force * machine.size, moment])
        compliance = _platform_compliance(situation)[:, :, situation.state_of]
        twist = np.einsum("ijn,jn->in", compliance, wrench) / _side_compliance(machine)
        twist[:3] *= machine.size
        return Signature(twist=twist[None])


def _side_compliance(machine: Machine) -> float:
    """Compliance of a long side in the machine file, mm/N."""
    return max(e.compliance for limb in machine.limbs for e in limb.elements if not e.turns)


def _platform_compliance(situation: Situation) -> Array:
    """Inverse of A^T A (6, 6, M), A the closure's rows whitened by their flexibility.

    In the engine's scaled twists (translations as parts of the machine's size).
    """
    closed, held = situation.closed, situation.parameters
    columns = held[:, None] if held.ndim == 1 else held
    rows, _ = Closure(situation.closing, columns, closed.extension, Standing.of(closed)).rows()
    stacked = np.moveaxis(rows, -1, 0)
    inverse = np.linalg.inv(np.swapaxes(stacked, 1, 2) @ stacked)
    return np.asarray(np.moveaxis(inverse, 0, -1))


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
        for axis in machine.axes:
            length = machine.nominal[machine.index(f"{axis.name}.h")]
            total += length * warming * situation.error_twists(f"{axis.name}.h")
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
            Unknown(f"parallelogram-sides.{axis.name}", "mm", 0.05) for axis in rows.machine.axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each limb alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Half a difference longer on one side, half shorter on the other."""
        return Signature(
            twist=np.array(
                [
                    0.5 * situation.error_twists(f"{axis.name}.dh1")
                    - 0.5 * situation.error_twists(f"{axis.name}.dh2")
                    for axis in situation.machine.axes
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
            Unknown(f"joint-azimuth.{axis.name}", "rad", 1e-3) for axis in rows.machine.axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each limb alone."""
        return alone(len(rows.machine.actuators))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Turn of the joint's frame on the platform."""
        return Signature(
            twist=np.array(
                [
                    situation.error_twists(f"{axis.name}.dtheta_Bz")
                    for axis in situation.machine.axes
                ]
            )
        )


EFFECTS = (TripodGravity(), TripodThermal(), ParallelogramSides(), JointAzimuth())
