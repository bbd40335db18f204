"""What acts between two moments, or from one on: a tracker put back, an actuator that slips twice.

Columns are summed over the readings from one moment to another, the geometry freed with them
(:mod:`calib.look.scan`), for every pair of a grid of moments; the best pair is then moved reading
by reading.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, IntArray
from calib.identify.fitting import Fit
from calib.look.scan import freed

GRID = 60
"""Moments that are tried against one another."""
LEAST = 3
"""Readings within, before and after."""
CLEAR = 30.0
"""Fall by which two moments must beat one."""


@dataclass(frozen=True, eq=False)
class Box:
    """Columns that act in accepted readings ``first`` to ``last`` - 1 of A, with ``sizes`` (k,)."""

    first: int
    last: int
    fall: float
    sizes: Array


class Sums:
    """Running sums of columns (k, 3, A) over the accepted readings of a fit."""

    def __init__(self, fitted: Fit, columns: Array) -> None:
        jacobian = fitted.linear.jacobian[:, :, fitted.accepted]
        residual = fitted.linear.whitened[:, fitted.accepted]
        self.count = residual.shape[1]
        self.weights = _summed(np.einsum("kin,lin->nkl", columns, columns))
        self.scores = _summed(np.einsum("kin,in->nk", columns, residual))
        self.mixed = _summed(np.einsum("pin,kin->npk", jacobian, columns))
        self.taken = np.einsum("pq,nqk->npk", fitted.step_covariance, self.mixed)

    def best(self) -> Box | None:
        """The span of readings whose columns lower the cost most; to the run's end if that does."""
        grid = np.unique(np.linspace(0, self.count, GRID + 1).astype(np.intp))
        ends = np.full(1, self.count)
        steps = np.arange(LEAST, self.count - LEAST + 1)
        if steps.size == 0:
            return None
        step = self._best_of(steps, np.broadcast_to(ends, steps.shape))
        first, last = (one.ravel() for one in np.meshgrid(grid, grid, indexing="ij"))
        inner = (last - first >= LEAST) & (first >= LEAST) & (last <= self.count - LEAST)
        if not inner.any():
            return step
        box = self._best_of(first[inner], last[inner])
        for _ in range(2):
            firsts = np.arange(LEAST, box.last - LEAST + 1)
            box = self._best_of(firsts, np.full(firsts.shape, box.last))
            lasts = np.arange(box.first + LEAST, self.count - LEAST + 1)
            box = self._best_of(np.full(lasts.shape, box.first), lasts)
        return box if box.fall > step.fall + CLEAR else step

    def _best_of(self, first: IntArray, last: IntArray) -> Box:
        weights = self.weights[last] - self.weights[first]
        scores = self.scores[last] - self.scores[first]
        mixed = self.mixed[last] - self.mixed[first]
        taken = self.taken[last] - self.taken[first]
        weights = weights - np.einsum("npk,npl->nkl", mixed, taken)
        fall, sizes = freed(weights, scores)
        at = int(np.argmax(fall))
        return Box(int(first[at]), int(last[at]), float(fall[at]), sizes[at])


def _summed(values: Array) -> Array:
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
