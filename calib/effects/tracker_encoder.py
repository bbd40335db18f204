"""Eccentric circles of the tracker: its angles err once per turn.

    azimuth   a -> a + A sin a + B cos a,     elevation   e -> e + C sin e + D cos e

in the tracker frame. Over the part of a turn that one station sees, an error twice per turn has the
same shape; it goes by the same name.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.runs.stack import Rows
from calib.unknown import Unknown


class TrackerEncoder(Effect):
    """A sine and a cosine for each of the two circles."""

    id = "tracker-encoder"
    kind = "measurement"
    says = "an angle encoder of the tracker errs once per turn: eccentric circle"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``tracker-encoder.azimuth.sin`` .. ``.elevation.cos``, rad."""
        return tuple(
            Unknown(f"tracker-encoder.{circle}.{wave}", "rad", 3e-5)
            for circle in ("azimuth", "elevation")
            for wave in ("sin", "cos")
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each circle alone."""
        return ((0, 1), (2, 3))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Turns of the beam about the vertical axis, and in the plane of beam and vertical."""
        x, y, z = situation.point
        level = np.hypot(x, y)
        azimuth, elevation = np.arctan2(y, x), np.arctan2(z, level)
        sideways = np.stack([-y, x, np.zeros_like(x)])
        upwards = np.stack([-z * x / level, -z * y / level, level])
        shape = np.zeros((4, *situation.point.shape))
        for first, angle, turned in ((0, azimuth, sideways), (2, elevation, upwards)):
            shape[first] = np.sin(angle) * turned
            shape[first + 1] = np.cos(angle) * turned
        return Signature(point=shape)


EFFECTS = (TrackerEncoder(),)
