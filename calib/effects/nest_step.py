"""A nest of the platform is elsewhere from some moment on: it moved when it was touched.

    nest + d   from t0 to the end of that run

One nest alone, or several at one moment. All nests together, as one rigid step, are
``frame-shift``; what a nest was off by all along is ``nest-offset``. The moment is searched between
readings of the same nest, as nothing else tells it from an offset.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.effects.component import Scan, Signature, Situation, alone
from calib.effects.nest_offset import nest_steps, nests_of
from calib.effects.one_step import OneStep
from calib.effects.run_clock import between, from_then_on, run_starts
from calib.runs.stack import Rows
from calib.unknown import Unknown

EDGE = 0.1
"""Part of a nest's readings at either end in which a step cannot be told from bad readings."""
SIZE_MM = 0.05


class NestStep(OneStep):
    """Three components for each nest, and one moment."""

    id = "nest-step"
    kind = "measurement"
    says = "an SMR nest is elsewhere from some moment on: it moved when it was touched"

    def unavailable(self, rows: Rows) -> str:
        """Some nest must have been read several times."""
        return "" if self.moments(rows).size else "no nest has been read often enough"

    def moments(self, rows: Rows) -> Array:
        """Moments between successive readings of one nest, over all nests and runs."""
        names = np.array(rows.nest_name)
        found = [np.zeros(0)]
        for run, start in enumerate(run_starts(rows)):
            for name in nests_of(rows):
                own = (rows.run == run) & rows.on_platform & (names == name)
                edge = max(1, int(EDGE * np.count_nonzero(own)))
                found.append(start + between(np.sort(rows.moment[own]), edge))
        return np.unique(np.concatenate(found))

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``nest-step.4.x`` ..., mm, platform frame; ``.t0`` in s."""
        steps = (
            Unknown(f"nest-step.{name}.{axis}", "mm", SIZE_MM)
            for name in nests_of(rows)
            for axis in "xyz"
        )
        return (*steps, self.t0(rows))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each nest alone."""
        return alone(len(nests_of(rows)), 3)

    def scan(self, situation: Situation, trials: Sequence[tuple[float, ...]]) -> Scan | None:
        """Nests, from every moment on."""
        rows = situation.rows
        return Scan(
            (Signature(nest=nest_steps(rows)),),
            np.zeros(len(trials), dtype=np.intp),
            np.array([[from_then_on(rows, rows.moment, moment)] for (moment,) in trials], float),
        )

    def signature(self, situation: Situation, values: Array) -> Signature:
        """A unit step of one nest along one platform axis; the moment itself does not move."""
        rows = situation.rows
        steps = nest_steps(rows) * from_then_on(rows, rows.moment, float(values[-1]))
        return Signature(nest=np.concatenate([steps, np.zeros_like(steps[:1])]))


EFFECTS = (NestStep(),)
