"""One actuator is off from some moment on: an index or counts lost, a coupling that slipped.

    extension_i = d_i   from t0 to the end of that run

The moment is searched between the stops of the machine. Several runs stand one after the other on
the clock of t0; homing before the next one brings the actuator back.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.runs.stack import Rows
from calib.unknown import Unknown

MOMENTS = 40
"""Most moments that are tried."""
EDGE = 0.06
"""Part of the stops at either end in which a step cannot be told from bad readings."""


class ActuatorStep(Effect):
    """A step for each actuator, alone or with others, all at one moment ``t0``."""

    id = "actuator-step"
    kind = "machine"
    says = "a leg or drive is off from some moment on: it lost counts or its index, or slipped"
    depends = ("run", "time_s")

    def unavailable(self, rows: Rows) -> str:
        """Time must pass between stops."""
        return "" if _every_moment(rows).size else "too few readings at different times"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``actuator-step.leg1`` .., mm or rad; ``.t0`` in s."""
        moments = _every_moment(rows)
        gap = float(np.median(np.diff(moments))) if moments.size > 1 else 1.0
        steps = (
            Unknown(f"actuator-step.{axis.name}", axis.unit, axis.lost_motion)
            for axis in rows.machine.axes
        )
        return (*steps, Unknown("actuator-step.t0", "s", gap, sigma=0.5 * gap, nonlinear=True))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Moments over all runs."""
        for moment in _moments(rows):
            yield (float(moment),)

    def refined(self, rows: Rows, trial: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
        """Every moment between the neighbouring ones that were tried."""
        tried, every = _moments(rows), _every_moment(rows)
        at = int(np.searchsorted(tried, trial[0]))
        low, high = tried[max(at - 1, 0)], tried[min(at + 1, tried.size - 1)]
        for moment in every[(every >= low) & (every <= high)]:
            yield (float(moment),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """One from the moment on, in its run; the moment itself does not move."""
        rows = situation.rows
        starts, ends = _run_clock(rows)
        run = int(np.clip(np.searchsorted(starts, values[-1], side="right") - 1, 0, ends.size - 1))
        after = (rows.run == run) & (rows.time_s + starts[rows.run] >= values[-1])
        steps = per_actuator(np.tile(after.astype(np.float64), (len(rows.machine.actuators), 1)))
        return Signature(extension=np.concatenate([steps, np.zeros_like(steps[:1])]))


def _run_clock(rows: Rows) -> tuple[Array, Array]:
    """Where every run begins and ends (K,) if they stand one after the other, s."""
    runs = range(len(rows.runs))
    spans = np.array([np.max(rows.time_s[rows.run == k], initial=0.0) + 1.0 for k in runs])
    ends = np.cumsum(spans)
    return ends - spans, ends


def _moments(rows: Rows) -> Array:
    """Moments that are tried first."""
    between = _every_moment(rows)
    if between.size <= MOMENTS:
        return between
    return np.asarray(between[np.linspace(0, between.size - 1, MOMENTS).astype(int)])


def _every_moment(rows: Rows) -> Array:
    """Moments between successive stops with a reading, away from the ends of each run."""
    starts, _ = _run_clock(rows)
    found = []
    for run, start in enumerate(starts):
        here = (rows.run == run) & rows.on_platform
        stops, first = np.unique(rows.path.stop[rows.at[here]], return_index=True)
        times = np.sort(rows.time_s[here][first])
        edge = max(2, int(EDGE * stops.size))
        inner = times[edge : times.size - edge]
        found.append(start + 0.5 * (inner[1:] + inner[:-1])[np.diff(inner) > 0])
    return np.concatenate(found)


EFFECTS = (ActuatorStep(),)
