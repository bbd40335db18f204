"""One clock over several runs, one after the other, for what happens at a moment of one of them."""

import numpy as np

from calib.arrays import Array, BoolArray
from calib.runs.stack import Rows
from calib.unknown import Moment

MOMENTS = 40
"""Most moments that are tried."""


def run_starts(rows: Rows) -> Array:
    """Where every run begins (K,) if they stand one after the other, s."""
    runs = range(len(rows.runs))
    spans = np.array([np.max(rows.time_s[rows.run == k], initial=0.0) + 1.0 for k in runs])
    return np.asarray(np.cumsum(spans) - spans)


def moment_of(rows: Rows) -> Moment:
    """What a moment on that clock means."""
    return Moment(tuple(run_starts(rows).tolist()))


def from_then_on(rows: Rows, times: Array, moment: float) -> BoolArray:
    """Which readings (N,), at ``times`` of their run, come after a moment within the same run."""
    starts = run_starts(rows)
    run = int(np.clip(np.searchsorted(starts, moment, side="right") - 1, 0, starts.size - 1))
    return np.asarray((rows.run == run) & (times + starts[rows.run] >= moment))


def between(times: Array, edge: int) -> Array:
    """Moments between successive sorted ``times``, ``edge`` of them left out at either end."""
    inner = times[edge : times.size - edge]
    return np.asarray(0.5 * (inner[1:] + inner[:-1])[np.diff(inner) > 0])


def spread(moments: Array) -> Array:
    """Those of all moments that are tried first."""
    if moments.size <= MOMENTS:
        return moments
    return np.asarray(moments[np.linspace(0, moments.size - 1, MOMENTS).astype(int)])


def about(tried: Array, every: Array, moment: float) -> Array:
    """Every moment between the neighbours of one that was tried."""
    at = int(np.searchsorted(tried, moment))
    low, high = tried[max(at - 1, 0)], tried[min(at + 1, tried.size - 1)]
    return np.asarray(every[(every >= low) & (every <= high)])
