"""Covariances of readings, six numbers a reading, as matrices."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def covariance_matrices(six: Array) -> Array:
    """Symmetric matrices (3, 3, N) from ``six`` (6, N): xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
