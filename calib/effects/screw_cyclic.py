"""Once-per-turn error of each screw: extension_i = A_i sin(2 pi s_i / p) + B_i cos(2 pi s_i / p).

The period p comes from the machine file (``[effects.screw-cyclic] period``), else it is searched:
between 1 and 25 mm, or between 2 pi / 200 and 2 pi for rotary actuators. A period belongs to
actuators of one unit: where linear and rotary ones are mixed, ``screw-cyclic`` is that of the
linear ones and ``encoder-cyclic`` that of the rotary ones.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from calib.arrays import Array, IntArray
from calib.effects.component import Effect, Scan, Signature, Situation, alone, per_actuator
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.unknown import Unknown

OVERSAMPLING = 3.0
"""Trial frequencies for each independent one (1 / range of s)."""
WHOLE = 1.0
"""Periods through which poses must take an actuator before its wave is unlike a gain."""


class ScrewCyclic(Effect):
    """A sine and a cosine for each actuator of one unit, and one period for all of them."""

    id = "screw-cyclic"
    kind = "machine"
    says = "each screw errs once per turn: eccentric nut, bearing or encoder"

    def axes(self, machine: Machine) -> IntArray:
        """The actuators that may err, by index: all of the first unit, linear before rotary."""
        return next(iter(machine.axes_by_unit.values()))

    def hard_to_see(self, machine: Machine, extension: Array) -> str:
        """No actuator goes through a period: its wave is then much like a gain and an offset."""
        given, axes = self.given_period(machine), self.axes(machine)
        periods = [given or machine.axes[index].longest for index in axes]
        turned = max(np.ptp(extension[axes], axis=1) / np.array(periods))
        if turned >= WHOLE:
            return ""
        period = "a period" if given else "the longest period that is looked for"
        return f"the poses take no actuator through more than {turned:.2f} of {period}"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``screw-cyclic.leg1.sin``, ``.cos`` ..., then ``screw-cyclic.period`` if searched."""
        axes = [rows.machine.axes[index] for index in self.axes(rows.machine)]
        waves = tuple(
            Unknown(f"{self.id}.{axis.name}.{wave}", axis.unit, axis.usual_error)
            for axis in axes
            for wave in ("sin", "cos")
        )
        if self.given_period(rows.machine) is not None:
            return waves
        return (*waves, Unknown(f"{self.id}.period", axes[0].unit, 1.0, nonlinear=True))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(self.axes(rows.machine).size, 2)

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Equidistant frequencies, dense enough that none falls between two."""
        if self.given_period(rows.machine) is not None:
            yield ()
            return
        which = self.axes(rows.machine)
        axes = [rows.machine.axes[index] for index in which]
        span = max(float(np.ptp(rows.extension[which], axis=1).max()), 1e-9)
        low = 1.0 / max(axis.longest for axis in axes)
        high = 1.0 / min(axis.shortest for axis in axes)
        count = int(np.ceil((high - low) * span * OVERSAMPLING)) + 1
        for frequency in np.linspace(low, high, max(count, 2)):
            yield (1.0 / float(frequency),)

    def scan(self, situation: Situation, trials: Sequence[tuple[float, ...]]) -> Scan | None:
        """Sines and cosines of every trial's period."""
        if self.given_period(situation.machine) is not None:
            return None
        which, s = self.axes(situation.machine), situation.rows.extension
        periods = np.array(trials)[:, 0, None, None]
        phase = 2.0 * np.pi * s[which] / periods
        factors = np.stack([np.sin(phase), np.cos(phase)], axis=2)
        moved = np.repeat(per_actuator(np.ones_like(s))[which], 2, axis=0)
        return Scan(
            (Signature(extension=moved),),
            np.zeros(len(trials), dtype=np.intp),
            factors.reshape(len(trials), -1, s.shape[1]),
        )

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Sine and cosine, and the derivative by the period."""
        which, s = self.axes(situation.machine), situation.rows.extension
        given = self.given_period(situation.machine)
        period = float(values[-1]) if given is None else given
        phase = 2.0 * np.pi * s[which] / period
        n, sines, cosines = which.size, np.sin(phase), np.cos(phase)
        shape = np.zeros((2 * n + (given is None), *s.shape))
        own = 2 * np.arange(n)
        shape[own, which], shape[own + 1, which] = sines, cosines
        if given is None:
            sine, cosine = values[0 : 2 * n : 2, None], values[1 : 2 * n : 2, None]
            slope = sine * cosines - cosine * sines
            shape[-1, which] = -slope * phase / period
        return Signature(extension=shape)

    def given_period(self, machine: Machine) -> float | None:
        """The period that the machine file states; None where it is searched for."""
        table = machine.extra.get("effects")
        own = table.get(self.id) if isinstance(table, dict) else None
        period = own.get("period") if isinstance(own, dict) else None
        return float(period) if isinstance(period, int | float) else None


class EncoderCyclic(ScrewCyclic):
    """The same of rotary actuators beside linear ones."""

    id = "encoder-cyclic"
    says = "each rotary actuator errs once per turn: eccentric encoder or gear"

    def lacking(self, machine: Machine) -> str:
        """Linear and rotary actuators must be mixed."""
        mixed = len(machine.axes_by_unit) > 1
        return "" if mixed else "its actuators are of one kind: screw-cyclic is theirs"

    def axes(self, machine: Machine) -> IntArray:
        """The rotary actuators, by index."""
        return machine.axes_by_unit["rad"]


EFFECTS = (ScrewCyclic(), EncoderCyclic())
