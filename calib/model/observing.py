"""From where a point is to what an instrument reads of it, and the derivative.

With p the point in the instrument's frame and s the other end of a distance (zero: the instrument),

    point, place    p                       1
    direction       n . p                   n
    touched plane   n . (p - c)             n
    distance        |p - s|                 (p - s)^T / |p - s|
    azimuth         atan2(y, x)             (-y, x, 0) / (x^2 + y^2)
    elevation       atan2(z, hypot(x, y))   (-x z, -y z, x^2 + y^2) / (hypot(x, y) |p|^2)
    tilt            asin(R a . up)          by a rotation w of the platform: w . (R a x up) / cos
    attitude        log(R_read R^T)         by the same: w, to first order

and a constant, where an instrument has one. A gauge, calipers or a bar with a scale of its own show
(1 + s) times their length, the constant included: what is displayed is too long by a part of it.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.effects.lever import apply
from calib.mechanism.rigid import cross, logarithm, product, rotate
from calib.runs.sensed import Sensed
from calib.runs.sensing import ANGLES, DIRECTION, DISTANCE, POINT, POSE, TILT


@dataclass(frozen=True, eq=False)
class Observed:
    """What instruments read.

    Attributes
    ----------
    value : (3, N)
        Predicted components, mm or rad.
    slope : (3, 3, N)
        Derivative by the point, along the axes of the frame.
    turner : (3, 3, N)
        Whitened derivative by a rotation of the platform about these axes.
    rotation : (3, 3, N)
        Of the platform in the frame.
    """

    sensed: Sensed
    value: Array
    slope: Array
    turner: Array
    rotation: Array

    def misfit(self, read: Array) -> tuple[Array, Array]:
        """Read minus predicted (3, N), in mm or rad, and the same whitened; attitudes as rotations.

        Azimuths are compared on the shorter way round.
        """
        sensed = self.sensed
        residual = (read - self.value) * sensed.seen
        here = sensed.kind == ANGLES
        residual[0, here] = np.mod(residual[0, here] + np.pi, 2.0 * np.pi) - np.pi
        turned = self._turned()
        whitened = apply(sensed.whitener, residual) + apply(sensed.turner, turned)
        return np.where(sensed.turn, turned, residual), whitened

    def _turned(self) -> Array:
        """Rotation vectors (3, N), frame axes, from predicted to read attitudes; else zero."""
        here = self.sensed.turn
        out = np.zeros((3, here.size))
        if here.any():
            back = np.swapaxes(self.rotation[:, :, here], 0, 1)
            out[:, here] = logarithm(product(self.sensed.attitude[:, :, here], back))
        return out


@dataclass(frozen=True, eq=False)
class Ends:
    """What readings refer to, beside the point: other ends (3, N), planes, rotations of platforms.

    ``normal`` (3, N) and ``offset`` (N,) are of the plane or direction along which is measured;
    ``zero`` (N,) constants; ``scale`` (N,) parts by which lengths are too long;
    ``rotation`` (3, 3, N) of the platform in the frame; ``up`` (3, N).
    """

    second: Array
    normal: Array
    offset: Array
    zero: Array
    scale: Array
    rotation: Array
    up: Array


def observe(sensed: Sensed, point: Array, ends: Ends) -> Observed:
    """What is read of points (3, N) in their instruments' frames."""
    count = point.shape[1]
    value, slope = np.zeros((3, count)), np.zeros((3, 3, count))
    turning = np.zeros((3, 3, count))
    of = sensed.kind
    placed = np.isin(of, (POINT, POSE))
    value[:, placed] = point[:, placed]
    for axis in range(3):
        slope[axis, axis, placed] = 1.0
    here = of == DIRECTION
    value[0, here] = (np.einsum("in,in->n", ends.normal, point) - ends.offset)[here]
    slope[0][:, here] = ends.normal[:, here]
    here = (of == DISTANCE) & ~sensed.ghost
    second = np.nan_to_num(ends.second)
    far = np.flatnonzero(sensed.partner >= 0)
    second[:, far] = point[:, sensed.partner[far]]
    apart = point[:, here] - second[:, here]
    length = np.linalg.norm(apart, axis=0)
    value[0, here], slope[0][:, here] = length, apart / np.maximum(length, 1e-12)
    slope[0][:, sensed.partner[far]] = -slope[0][:, far]
    here = of == ANGLES
    value[:2, here], slope[:2, :, here] = _angles(point[:, here])
    here = of == TILT
    tilted = rotate(ends.rotation, sensed.axis)[:, here]
    sine = np.clip(np.sum(tilted * ends.up[:, here], axis=0), -1.0, 1.0)
    value[0, here] = np.arcsin(sine)
    cosine = np.sqrt(np.maximum(1.0 - sine**2, 1e-12))
    turning[0][:, here] = cross(tilted, ends.up[:, here]) / cosine
    for axis in range(3):
        turning[axis, axis, sensed.turn] = 1.0
    value[0] = (value[0] + ends.zero) * (1.0 + ends.scale)
    slope[0] *= 1.0 + ends.scale
    whitener = np.where(sensed.turn, sensed.turner, sensed.whitener)
    turner = np.einsum("ijn,jkn->ikn", whitener, turning)
    return Observed(sensed, value * sensed.seen, slope, turner, ends.rotation)


def _angles(point: Array) -> tuple[Array, Array]:
    """Azimuth and elevation (2, M) of points (3, M), and their derivatives (2, 3, M)."""
    x, y, z = point
    level = x * x + y * y
    flat, far = np.sqrt(level), level + z * z
    value = np.stack([np.arctan2(y, x), np.arctan2(z, flat)])
    azimuth = np.stack([-y, x, np.zeros_like(x)]) / level
    elevation = np.stack([-x * z, -y * z, level]) / (flat * far)
    return value, np.stack([azimuth, elevation])
