"""One actuator is off from some moment on: an index or counts lost, a coupling that slipped.

    extension_i = d_i   from t0 to the end of that run

The moment is searched between the stops of the machine. Several runs stand one after the other on
the clock of t0; homing before the next one brings the actuator back, or to another place.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.effects.component import Scan, Signature, Situation, alone, per_actuator
from calib.effects.one_step import OneStep
from calib.effects.run_clock import between, from_then_on, run_starts
from calib.runs.stack import Rows
from calib.unknown import Unknown

EDGE = 0.06
"""Part of the stops at either end in which a step cannot be told from bad readings."""


class ActuatorStep(OneStep):
    """A step for each actuator, alone or with others, all at one moment ``t0``."""

    id = "actuator-step"
    kind = "machine"
    says = "a leg or drive is off from some moment on: it lost counts or its index, or slipped"
    depends = ("run", "time_s")

    def unavailable(self, rows: Rows) -> str:
        """Time must pass between stops."""
        return "" if self.moments(rows).size else "too few readings at different times"

    def moments(self, rows: Rows) -> Array:
        """Moments between successive stops with a reading, away from the ends of each run.

        Among them the start of every run but the first.
        """
        found = [self.at_any_rate(rows)]
        for run, start in enumerate(run_starts(rows)):
            here = (rows.run == run) & rows.on_platform
            stops, first = np.unique(rows.path.stop[rows.at[here]], return_index=True)
            times = np.sort(rows.time_s[here][first])
            found.append(start + between(times, max(2, int(EDGE * stops.size))))
        return np.sort(np.concatenate(found))

    def at_any_rate(self, rows: Rows) -> Array:
        """Starts of runs: an actuator comes back from homing, or from a repair, somewhere else."""
        return run_starts(rows)[1:]

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``actuator-step.leg1`` .., mm or rad; ``.t0`` in s."""
        steps = (
            Unknown(f"actuator-step.{axis.name}", axis.unit, axis.lost_motion)
            for axis in rows.machine.axes
        )
        return (*steps, self.t0(rows))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def scan(self, situation: Situation, trials: Sequence[tuple[float, ...]]) -> Scan | None:
        """One from every moment on."""
        rows = situation.rows
        return Scan(
            (Signature(extension=per_actuator(np.ones_like(rows.extension))),),
            np.zeros(len(trials), dtype=np.intp),
            np.array([[from_then_on(rows, rows.time_s, moment)] for (moment,) in trials], float),
        )

    def signature(self, situation: Situation, values: Array) -> Signature:
        """One from the moment on, in its run; the moment itself does not move."""
        rows = situation.rows
        after = from_then_on(rows, rows.time_s, float(values[-1]))
        steps = per_actuator(np.tile(after.astype(np.float64), (len(rows.machine.actuators), 1)))
        return Signature(extension=np.concatenate([steps, np.zeros_like(steps[:1])]))


EFFECTS = (ActuatorStep(),)
