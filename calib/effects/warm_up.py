"""Drives that warm up: every leg is too long by A exp(-t / tau), t from the start of the run.

What grows with a thermometer's reading is ``thermal-growth``; here no thermometer stands where the
heat is, and only the clock tells.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.effects.fading import time_constant
from calib.effects.tracker import run_prefix
from calib.mechanism.axes import units_of
from calib.runs.stack import Rows
from calib.unknown import Unknown

SHORTEST_S, LONGEST_S = 120.0, 7200.0
TRIALS = 14


class WarmUp(Effect):
    """One amplitude for all actuators of a unit in each run, and one time constant."""

    id = "warm-up"
    kind = "machine"
    says = "every leg or drive creeps by the same amount while the machine warms up"
    depends = ("run", "time_s")

    def unavailable(self, rows: Rows) -> str:
        """Time must pass."""
        passed = np.ptp(rows.time_s[rows.on_platform]) if rows.on_platform.any() else 0.0
        return "" if passed > 0.0 else "all readings have the same time"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``warm-up.A``, mm or rad (``A_linear``, ``A_rotary`` where both are), ``.tau`` in s.

        With several runs each has its own amplitudes, by number.
        """
        units = rows.machine.axes_by_unit
        axes = rows.machine.axes
        amplitudes = tuple(
            Unknown(
                f"warm-up.{run_prefix(rows, run)}A"
                + (f"_{axes[which[0]].kind}" if len(units) > 1 else ""),
                unit,
                axes[which[0]].lost_motion,
            )
            for run in range(len(rows.runs))
            for unit, which in units.items()
        )
        return (*amplitudes, Unknown("warm-up.tau", "s", 1200.0, sigma=LONGEST_S, nonlinear=True))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """From two minutes to two hours, in equal ratios; of several runs to the longest one.

        What hardly fades in a run is a machine that differs from run to run, and no warm-up.
        """
        spans = [np.ptp(rows.time_s[rows.run == run]) for run in range(len(rows.runs))]
        longest = LONGEST_S if len(spans) == 1 else min(LONGEST_S, max(2 * SHORTEST_S, *spans))
        for tau in np.geomspace(SHORTEST_S, longest, TRIALS):
            yield (float(tau),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """What is left of the warm-up; and its derivative by tau."""
        rows, tau = situation.rows, time_constant(values[-1])
        axes = rows.machine.axes
        left = np.exp(-rows.time_s / tau)
        shape = np.zeros((values.size, len(axes), rows.count))
        number = 0
        for run in range(len(rows.runs)):
            for which in units_of(axes).values():
                size = np.array([axes[k].lost_motion for k in which])
                here = (size / size[0])[:, None] * left * (rows.run == run)
                shape[number, which] = here
                shape[-1, which] += values[number] * here * rows.time_s / tau**2
                number += 1
        return Signature(extension=shape)


EFFECTS = (WarmUp(),)
