"""A nest of the platform is elsewhere from some moment on: it moved when it was touched.

    nest + d   from t0 to the end of that run

One nest alone, or several at one moment. All nests together, as one rigid step, are
``frame-shift``; what a nest was off by all along is ``nest-offset``. The moment is searched between
readings of the same nest, as nothing else tells it from an offset.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Scan, Signature, Situation, alone
from calib.effects.nest_offset import nest_steps, nests_of
from calib.effects.run_clock import about, between, from_then_on, run_starts, spread
from calib.runs.stack import Rows
from calib.unknown import Unknown

EDGE = 0.1
"""Part of a nest's readings at either end in which a step cannot be told from bad readings."""
SIZE_MM = 0.05


class NestStep(Effect):
    """Three components for each nest, and one moment."""

    id = "nest-step"
    kind = "measurement"
    says = "an SMR nest is elsewhere from some moment on: it moved when it was touched"
    ends_with_run = True

    def unavailable(self, rows: Rows) -> str:
        """Some nest must have been read several times."""
        return "" if _every_moment(rows).size else "no nest has been read often enough"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``nest-step.4.x`` ..., mm, platform frame; ``.t0`` in s."""
        moments = _every_moment(rows)
        gap = float(np.median(np.diff(moments))) if moments.size > 1 else 1.0
        steps = (
            Unknown(f"nest-step.{name}.{axis}", "mm", SIZE_MM)
            for name in nests_of(rows)
            for axis in "xyz"
        )
        return (*steps, Unknown("nest-step.t0", "s", gap, sigma=0.5 * gap, nonlinear=True))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each nest alone."""
        return alone(len(nests_of(rows)), 3)

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Moments over all runs."""
        for moment in spread(_every_moment(rows)):
            yield (float(moment),)

    def refined(self, rows: Rows, trial: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
        """Every moment between the neighbouring ones that were tried."""
        every = _every_moment(rows)
        for moment in about(spread(every), every, trial[0]):
            yield (float(moment),)

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


def _every_moment(rows: Rows) -> Array:
    """Moments between successive readings of one nest, over all nests and runs."""
    names = np.array(rows.nest_name)
    found = [np.zeros(0)]
    for run, start in enumerate(run_starts(rows)):
        for name in nests_of(rows):
            own = (rows.run == run) & rows.on_platform & (names == name)
            edge = max(1, int(EDGE * np.count_nonzero(own)))
            found.append(start + between(np.sort(rows.moment[own]), edge))
    return np.unique(np.concatenate(found))


EFFECTS = (NestStep(),)
