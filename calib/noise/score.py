"""Whether a component of noise is worth asking for at all: score tests where there is none yet.

The likelihood rises by about z^2 / 2 where its slope at nothing is z standard deviations. One pass
over the residual of a fit gives z; the sizes of what it does not point to need not be searched.
M = I - G^T G is the covariance of the residual (:mod:`calib.evidence.problem`), of which the blocks
of the readings that are compared are counted.
"""

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.noise.component import Taking
from calib.noise.scatter import blocks_left

POINTS = 0.8
"""Standard deviations from which correlation and visits are asked for: a rise of 0.3."""
POINTS_TO_SCALE = 2.0
"""The same of the scale alone: the stated sigmas are trusted unless clearly wrong."""


def promising(residual: Array, absorbed: Array, taking: Taking) -> set[str]:
    """Which of ``time``, ``visit`` and ``scale`` the residual of white noise points to.

    Parameters
    ----------
    residual : (3, A)
        Of a fit, in stated sigmas.
    absorbed : (p, 3, A)
        Its G.
    taking : Taking
    """
    found = set()
    left = blocks_left(absorbed, taking.live)
    if taking.alike and _along_time(residual, absorbed, left, taking) > POINTS:
        found.add("time")
    if np.any(taking.visit >= 0) and _by_visit(residual, absorbed, taking) > POINTS:
        found.add("visit")
    freedom = max(float(np.einsum("iin->", left)), 1.0)
    off = abs(float(np.sum(residual**2)) - freedom) / np.sqrt(2.0 * freedom)
    if off > (POINTS if found else POINTS_TO_SCALE):
        found.add("scale")
    return found


def _along_time(residual: Array, absorbed: Array, left: Array, taking: Taking) -> float:
    """How far products of successive readings are above chance: of all pairs, or the close ones."""
    order, gaps = taking.order, taking.gaps()
    inside = np.flatnonzero(np.isfinite(gaps))
    if not inside.size:
        return 0.0
    first, second = order[inside - 1], order[inside]
    close = gaps[inside] <= np.median(gaps[inside])
    return max(
        _products(residual, absorbed, left, first[chosen], second[chosen])
        for chosen in (np.ones_like(close), close)
    )


def _products(
    residual: Array, absorbed: Array, left: Array, first: IntArray, second: IntArray
) -> float:
    seen = float(np.sum(residual[:, first] * residual[:, second]))
    expected = -float(np.einsum("pin,pin->", absorbed[:, :, first], absorbed[:, :, second]))
    spread = float(np.einsum("ijn,jin->", left[:, :, first], left[:, :, second]))
    return (seen - expected) / float(np.sqrt(max(spread, 1e-9)))


def _by_visit(residual: Array, absorbed: Array, taking: Taking) -> float:
    """How far the actuators' common errors of each visit are above chance."""
    on: BoolArray = taking.visit >= 0
    _, visit = np.unique(taking.visit[on], return_inverse=True)
    motions = taking.motions[:, :, on]
    count = int(visit.max()) + 1

    def summed(each: Array) -> Array:
        flat = each.reshape(-1, visit.size)
        total = np.array([np.bincount(visit, row, count) for row in flat])
        return total.reshape(*each.shape[:-1], count)

    pushed = summed(np.einsum("uin,in->un", motions, residual[:, on]))
    taken = summed(np.einsum("uin,pin->upn", motions, absorbed[:, :, on]))
    size = summed(np.einsum("uin,vin->uvn", motions, motions))
    size -= np.einsum("upn,vpn->uvn", taken, taken)
    seen, expected = float(np.sum(pushed**2)), float(np.einsum("uun->", size))
    spread = 2.0 * float(np.einsum("uvn,vun->", size, size))
    return (seen - expected) / float(np.sqrt(max(spread, 1e-9)))
