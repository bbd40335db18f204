"""Gears err with the turn of their motor: waves of one and two periods a turn of the motor.

    extension_i = sum over h of  A_hi sin(h G_i s_i) + B_hi cos(h G_i s_i),   h = 1, 2

G_i is the gear ratio that the machine file states (``gear``), one for each joint: strain wave gears
err twice, planets and cogging once a turn of the motor. What errs with the turn of the joint itself
is ``screw-cyclic``.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.unknown import Unknown

HARMONICS = (1, 2)
WAVES = ("sin", "cos")
EACH = len(HARMONICS) * len(WAVES)


class GearCyclic(Effect):
    """A sine and a cosine of each harmonic for each actuator with a gear."""

    id = "gear-cyclic"
    kind = "machine"
    says = "gears err with the turn of their motors: eccentric parts, cogging, a strain wave"

    def lacking(self, machine: Machine) -> str:
        """Gear ratios must be known."""
        return "" if _geared(machine) else "no actuator states its gear (gear = 101)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``gear-cyclic.q1.sin1``, ``.cos1``, ``.sin2``, ``.cos2`` ..., rad."""
        axes = rows.machine.axes
        return tuple(
            Unknown(f"gear-cyclic.{axes[k].name}.{wave}{order}", axes[k].unit, axes[k].usual_error)
            for k in _geared(rows.machine)
            for order in HARMONICS
            for wave in WAVES
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each harmonic of each gear alone, and each gear."""
        count = len(_geared(rows.machine))
        single = [(2 * k, 2 * k + 1) for k in range(count * len(HARMONICS))]
        return (*single, *(tuple(range(EACH * k, EACH * k + EACH)) for k in range(count)))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Waves along each coordinate."""
        machine, s = situation.machine, situation.rows.extension
        geared = _geared(machine)
        shape = np.zeros((EACH * len(geared), *s.shape))
        for number, k in enumerate(geared):
            for place, order in enumerate(HARMONICS):
                phase = order * machine.actuators[k].gear * s[k]
                first = EACH * number + len(WAVES) * place
                shape[first, k], shape[first + 1, k] = np.sin(phase), np.cos(phase)
        return Signature(extension=shape)


def _geared(machine: Machine) -> list[int]:
    """Actuators whose gear ratio is stated, by index."""
    return [k for k, actuator in enumerate(machine.actuators) if actuator.gear > 0.0]


EFFECTS = (GearCyclic(),)
