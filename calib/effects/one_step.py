"""What is off from one moment of one run on: the moment is searched between readings."""

from abc import abstractmethod
from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect
from calib.effects.run_clock import about, moment_of, spread
from calib.runs.stack import Rows
from calib.unknown import Unknown


class OneStep(Effect):
    """A step at ``t0``, the last and only nonlinear unknown, over before the next run."""

    ends_with_run = True

    @abstractmethod
    def moments(self, rows: Rows) -> Array:
        """Every moment (n,) at which it may step, s, on the clock of all runs."""

    def t0(self, rows: Rows) -> Unknown:
        """The moment, known to half of what lies between two of them."""
        moments = self.moments(rows)
        gap = float(np.median(np.diff(moments))) if moments.size > 1 else 1.0
        name, means = f"{self.id}.t0", moment_of(rows)
        return Unknown(name, "s", gap, sigma=0.5 * gap, nonlinear=True, means=means)

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Moments over all runs."""
        for moment in self._tried(rows):
            yield (float(moment),)

    def refined(self, rows: Rows, trial: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
        """Every moment between the neighbouring ones that were tried."""
        every = self.moments(rows)
        for moment in about(self._tried(rows), every, trial[0]):
            yield (float(moment),)

    def at_any_rate(self, rows: Rows) -> Array:
        """Moments that are tried however many there are."""
        return np.array([])

    def _tried(self, rows: Rows) -> Array:
        return np.union1d(spread(self.moments(rows)), self.at_any_rate(rows))
