"""Components of noise, in the sigmas that the readings state, and how the readings were taken.

A reading's noise, whitened by its own stated covariance, is

    n = R scale (sqrt(1 - share) w + sqrt(share) z) + B u

with R R^T = M what the reading's own sigmas must be corrected by (:mod:`calib.noise.scatter`),
w white, z an Ornstein-Uhlenbeck process of each whitened axis, correlated by exp(-dt / tau)
between readings dt apart in one run (or, by row, as if all successive ones were equally far apart:
an autoregressive process of first order), and u one error of every actuator for each visit of a
pose, in usual errors of the axes (B their displacements of the reading): a machine that does not
repeat.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.noise.scatter import Scatter, Sizes


@dataclass(frozen=True)
class Noise:
    """Sizes of the components.

    Attributes
    ----------
    scale : float
        Standard deviation over the stated one.
    tau_s : float
        Time constant of what is correlated, s; 0 if nothing is.
    share : float
        Part of the variance that is correlated.
    visit : float
        Standard deviation of the actuators' errors from visit to visit, in usual errors.
    by_row : bool
        Whether correlation falls from reading to reading, whatever the time between them.
    step : float
        Where what is correlated wanders without fading (``tau_s`` is far beyond the run): its steps
        over the usual gap, in white sigmas. 0 where it fades.
    scatter : tuple of (str, float)
        Sizes by which the readings' own sigmas are to be corrected, by name.
    """

    scale: float = 1.0
    tau_s: float = 0.0
    share: float = 1.0
    visit: float = 0.0
    by_row: bool = False
    step: float = 0.0
    scatter: Sizes = ()

    @property
    def stretched(self) -> bool:
        """Whether all that there is, is another scale than stated."""
        return self.tau_s <= 0.0 and self.visit <= 0.0 and not self.scatter

    @property
    def narrow(self) -> float:
        """Standard deviation, over the stated one, without what wanders."""
        return self.scale * float(np.sqrt(1.0 - self.share)) if self.step > 0.0 else self.scale


WHITE = Noise()


@dataclass(frozen=True, eq=False)
class Taking:
    """How A readings were taken.

    Attributes
    ----------
    run, time_s : (A,)
    visit : (A,)
        Number of the stop at which the platform was read; -1 where something else was.
    motions : (n, 3, A)
        Whitened displacement of each reading by a usual error of each actuator.
    live : (3, A) bool, optional
        Components that the readings hold, if not all.
    scatter : Scatter
        What the scatter of the readings may hang on.
    """

    run: IntArray
    time_s: Array
    visit: IntArray
    motions: Array
    live: BoolArray | None = None
    scatter: Scatter = field(default_factory=Scatter)

    @property
    def alike(self) -> bool:
        """Whether all readings hold the same components: only then are they alike in time."""
        return self.live is None or bool(np.all(self.live == self.live[:, :1]))

    def held(self) -> Array:
        """Number of components (A,) of each reading."""
        if self.live is None:
            return np.full(self.run.size, 3.0)
        return np.asarray(self.live.sum(axis=0), dtype=np.float64)

    @cached_property
    def order(self) -> IntArray:
        """Readings as they followed each other, run by run."""
        return np.lexsort((self.time_s, self.run)).astype(np.intp)

    def gaps(self, by_row: bool = False) -> Array:
        """Seconds (A,) since the reading before, in that order; infinite where a run begins.

        Readings with one time stamp were not taken at once: a twentieth of the usual gap stands
        between them. ``by_row``: the usual gap stands between all.
        """
        return self._gaps[int(by_row)]

    @cached_property
    def _gaps(self) -> tuple[Array, Array]:
        """In time, and by row."""
        run, time = self.run[self.order], self.time_s[self.order]
        gap = np.diff(time, prepend=time[:1])
        inside = np.diff(run, prepend=run[:1] - 1) == 0
        apart = gap[inside & (gap > 0.0)]
        usual = float(np.median(apart)) if apart.size else 1.0
        each = (np.maximum(gap, 0.05 * usual), np.full_like(gap, usual))
        in_time, by_row = (np.where(inside, one, np.inf) for one in each)
        return in_time, by_row

    @property
    def usual_gap_s(self) -> float:
        """Median time between successive readings, s."""
        gaps = self.gaps(by_row=True)
        return float(np.min(gaps)) if gaps.size > 1 else 1.0

    @property
    def span_s(self) -> float:
        """Duration of the longest run, s."""
        spans = [float(np.ptp(self.time_s[self.run == run])) for run in np.unique(self.run)]
        return max(spans, default=0.0)

    def variance_by_visit(self, noise: Noise) -> Array:
        """Covariance (3, 3, A) of the whitened readings by the machine's repeatability alone."""
        return np.asarray(noise.visit**2 * np.einsum("uin,ujn->ijn", self.motions, self.motions))
