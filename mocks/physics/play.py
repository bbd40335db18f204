"""Play between two parts: the element behind lost motion and hysteresis.

The driven part follows the driver until it reverses; then the driver must first cross the gap.
With gap b the driven part stands at s + o, where the offset o stays within +-b/2: after a move
forward o = -b/2, after a move back o = +b/2, and a reversal smaller than b moves only part of
the way. (Krasnosel'skii and Pokrovskii's play operator.)
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def advance(offset: Array, change: Array, widths: Array) -> Array:
    """Offsets after a monotone move.

    Parameters
    ----------
    offset : array, shape (..., K)
        Offset of each play element before the move, mm.
    change : array, broadcastable to (..., K)
        Move of the driver, mm.
    widths : array, broadcastable to (..., K)
        Full widths of the gaps, mm.

    Returns
    -------
    array, shape (..., K), mm
    """
    return np.clip(offset - change, -0.5 * widths, 0.5 * widths)


def follow(positions: Array, widths: Array) -> Array:
    """Offsets after each of a sequence of rests.

    Parameters
    ----------
    positions : array, shape (N, n)
        Driver positions of n legs, mm; the first row is where they rest without play.
    widths : array, shape (n, K)

    Returns
    -------
    array, shape (N, n, K), mm
    """
    out = np.zeros((*positions.shape, widths.shape[-1]))
    if not out.size:
        return out
    half = 0.5 * widths
    changes = np.diff(positions, axis=0)[:, :, None]
    for row, change in enumerate(changes):
        out[row + 1] = np.minimum(np.maximum(out[row] - change, -half), half)
    return out
