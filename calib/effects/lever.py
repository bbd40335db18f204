"""From the platform's twist to the whitened reading: matrices of each reading applied to many."""

import numpy as np

from calib.arrays import Array, BoolArray


def whitened_frame(whitener: Array, turn: Array) -> Array:
    """Whitener times frame rotation, (3, 3, N)."""
    return np.asarray(np.einsum("ijn,jkn->ikn", whitener, turn))


def lever_of(combined: Array, arm: Array, on_platform: BoolArray) -> Array:
    """Matrix (3, 6, N) from the platform's twist to the whitened reading; zero for base nests."""
    lever = np.empty((3, 6, arm.shape[1]))
    lever[:, :3] = combined
    for axis in range(3):  # combined (e x arm) for e along each axis
        one, other = (axis + 1) % 3, (axis + 2) % 3
        lever[:, 3 + axis] = combined[:, other] * arm[one] - combined[:, one] * arm[other]
    lever *= on_platform
    return lever


def through(lever: Array, twists: Array) -> Array:
    """(3, 6, N) and (U, 6, N) -> (U, 3, N)."""
    out = np.empty((twists.shape[0], 3, twists.shape[2]))
    for row in range(3):
        out[:, row] = np.einsum("kn,ukn->un", lever[row], twists)
    return out


def apply(matrix: Array, vector: Array) -> Array:
    """(3, 3, N) and (3, N) -> (3, N)."""
    out: Array = np.einsum("ijn,jn->in", matrix, vector)
    return out


def apply_each(matrix: Array, vectors: Array) -> Array:
    """(3, 3, N) and (U, 3, N) -> (U, 3, N)."""
    out: Array = np.einsum("ijn,ujn->uin", matrix, vectors)
    return out
