"""Once-per-turn error of each screw: extension_i = A_i sin(2 pi s_i / p) + B_i cos(2 pi s_i / p).

The period p comes from the machine file (``[effects.screw-cyclic] period``), else it is searched:
between 1 and 25 mm, or between 2 pi / 200 and 2 pi for rotary actuators.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown, alone, limb_names
from calib.mechanism.description import Machine
from calib.runs.stack import Rows

OVERSAMPLING = 3.0
"""Trial frequencies for each independent one (1 / range of s)."""


class ScrewCyclic(Effect):
    """A sine and a cosine for each actuator, and one period for all."""

    id = "screw-cyclic"
    kind = "machine"
    says = "each screw errs once per turn: eccentric nut, bearing or encoder"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``screw-cyclic.leg1.sin``, ``.cos`` ..., then ``screw-cyclic.period`` if searched."""
        unit = rows.machine.actuators[0].unit
        size = 0.01 if unit == "mm" else 1e-4
        waves = tuple(
            Unknown(f"screw-cyclic.{name}.{wave}", unit, size)
            for name in limb_names(rows.machine)
            for wave in ("sin", "cos")
        )
        if _given_period(rows.machine) is not None:
            return waves
        return (*waves, Unknown("screw-cyclic.period", unit, 1.0, nonlinear=True))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators), 2)

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Equidistant frequencies, dense enough that none falls between two."""
        if _given_period(rows.machine) is not None:
            yield ()
            return
        shortest, longest = (
            (1.0, 25.0) if rows.machine.actuators[0].unit == "mm" else (2 * np.pi / 200, 2 * np.pi)
        )
        span = max(float(np.ptp(rows.extension, axis=1).max()), 1e-9)
        low, high = 1.0 / longest, 1.0 / shortest
        count = int(np.ceil((high - low) * span * OVERSAMPLING)) + 1
        for frequency in np.linspace(low, high, max(count, 2)):
            yield (1.0 / float(frequency),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Sine and cosine, and the derivative by the period."""
        s = situation.rows.extension
        given = _given_period(situation.machine)
        period = float(values[-1]) if given is None else given
        phase = 2.0 * np.pi * s / period
        n = s.shape[0]
        shape = np.zeros((2 * n + (given is None), *s.shape))
        legs = np.arange(n)
        shape[2 * legs, legs] = np.sin(phase)
        shape[2 * legs + 1, legs] = np.cos(phase)
        if given is None:
            sine, cosine = values[0 : 2 * n : 2, None], values[1 : 2 * n : 2, None]
            slope = sine * np.cos(phase) - cosine * np.sin(phase)
            shape[-1] = -slope * phase / period
        return Signature(extension=shape)


def _given_period(machine: Machine) -> float | None:
    table = machine.extra.get("effects")
    own = table.get("screw-cyclic") if isinstance(table, dict) else None
    period = own.get("period") if isinstance(own, dict) else None
    return float(period) if isinstance(period, int | float) else None


EFFECTS = (ScrewCyclic(),)
