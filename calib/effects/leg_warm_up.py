"""Drives that warm up one more than another: extension_i = A_i exp(-t / tau) from the run's start.

``warm-up`` is the case in which all are alike.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, per_actuator
from calib.effects.fading import time_constant
from calib.effects.tracker import run_prefix
from calib.effects.warm_up import LONGEST_S, WarmUp
from calib.runs.stack import Rows
from calib.unknown import Unknown


class LegWarmUp(Effect):
    """One amplitude for each actuator in each run, and one time constant."""

    id = "leg-warm-up"
    kind = "machine"
    says = "legs or drives creep while they warm up, one more than another"
    depends = ("run", "time_s")

    def unavailable(self, rows: Rows) -> str:
        """Time must pass."""
        return WarmUp().unavailable(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``leg-warm-up.leg1`` .., mm or rad, by number with several runs; ``.tau`` in s."""
        amplitudes = tuple(
            Unknown(f"leg-warm-up.{run_prefix(rows, run)}{axis.name}", axis.unit, axis.lost_motion)
            for run in range(len(rows.runs))
            for axis in rows.machine.axes
        )
        tau = Unknown("leg-warm-up.tau", "s", 1200.0, sigma=LONGEST_S, nonlinear=True)
        return (*amplitudes, tau)

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone, in all runs."""
        count = len(rows.machine.actuators)
        return tuple(tuple(range(k, count * len(rows.runs), count)) for k in range(count))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """As for all drives alike."""
        yield from WarmUp().trials(rows)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """What is left of the warm-up; and its derivative by tau."""
        rows, tau = situation.rows, time_constant(values[-1])
        count = len(rows.machine.actuators)
        left = np.exp(-rows.time_s / tau)
        each = per_actuator(np.tile(left, (count, 1)))
        shape = np.concatenate([each * (rows.run == run) for run in range(len(rows.runs))])
        amplitudes = values[:-1].reshape(-1, count)[rows.run].T
        slope = amplitudes * left * rows.time_s / tau**2
        return Signature(extension=np.concatenate([shape, slope[None]]))


EFFECTS = (LegWarmUp(),)
