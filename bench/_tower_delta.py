"""A linear delta as 3D printers calibrate it: least squares over heights and distances.

As the documentation of Klipper describes its delta calibration: towers upright at one radius, the
angles of two of them, an end stop and an arm length each; what is least is the plain sum of squares
of the heights' errors and, where a part was measured, of the distances'. Written from that
description. With heights alone the arm lengths stay as they are.
"""

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from calib.arrays import Array, IntArray

START = np.array([130.0, 0.0, 2.0 * np.pi / 3.0, 0.0, 0.0, 0.0, 300.0, 300.0, 300.0])
"""Effective radius, two angles, three end stops, three arms; the third tower is at 240 deg."""
THIRD = 4.0 * np.pi / 3.0


def effector(numbers: Array, q: Array) -> Array:
    """Where the effector is (3, N) for carriages at q (3, N): below three spheres' meeting."""
    radius, first, second = numbers[:3]
    angles = np.array([first, second, THIRD])
    centre = np.array([radius * np.cos(angles), radius * np.sin(angles)])
    x, y = np.repeat(centre[:, :, None], q.shape[1], axis=2)
    z, arm = q + numbers[3:6, None], numbers[6:9, None]
    square = x**2 + y**2 + z**2 - arm**2
    # Differences of the spheres are planes: a x + b y = k - c z.
    a, b, c = x[1:] - x[:1], y[1:] - y[:1], z[1:] - z[:1]
    k = 0.5 * (square[1:] - square[:1])
    det = a[0] * b[1] - a[1] * b[0]
    x0, x1 = (k[0] * b[1] - k[1] * b[0]) / det, -(c[0] * b[1] - c[1] * b[0]) / det
    y0, y1 = (a[0] * k[1] - a[1] * k[0]) / det, -(a[0] * c[1] - a[1] * c[0]) / det
    one = x1**2 + y1**2 + 1.0
    half = x1 * (x0 - x[0]) + y1 * (y0 - y[0]) - z[0]
    rest = (x0 - x[0]) ** 2 + (y0 - y[0]) ** 2 + z[0] ** 2 - arm[0] ** 2
    height = (-half - np.sqrt(half**2 - one * rest)) / one
    return np.array([x0 + x1 * height, y0 + y1 * height, height])


@dataclass(frozen=True, eq=False)
class Measured:
    """Heights (N,) at q (3, N); distances (M,) between marks left at poses ``ends`` (2, M)."""

    q: Array
    heights: Array
    distances: Array
    ends: IntArray


def calibrate(measured: Measured, start: Array = START) -> Array:
    """Numbers (9,) with the least sum of squares."""
    free = np.arange(9) if measured.distances.size else np.arange(6)

    def errors(values: Array) -> Array:
        numbers = start.copy()
        numbers[free] = values
        points = effector(numbers, measured.q)
        first, second = points[:, measured.ends[0]], points[:, measured.ends[1]]
        apart = np.linalg.norm(first - second, axis=0)
        return np.concatenate([points[2] - measured.heights, apart - measured.distances])

    found = optimize.least_squares(errors, start[free], x_scale=np.maximum(start[free], 1.0) * 1e-2)
    numbers = start.copy()
    numbers[free] = found.x
    return numbers
