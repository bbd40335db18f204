"""The tripod's closed form (Feng et al. 2022, put right in docs/papers.md).

With o_i = (cos theta_i, sin theta_i, 0), sliders at l_i o_i and platform joints at b o_i from O'::

    |r - (l_i - b) o_i|^2 = h_i^2

for a platform that stays parallel. Two differences are linear in x and y; z < 0 is the lower root.
Errors that turn the platform are in ``mocks.physics.parallelograms``. mm and rad.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mocks.physics.pose import Array

LIMBS: tuple[str, ...] = ("limb1", "limb2", "limb3")
B_MM = 180.0
HOME_Q = 410.0


@dataclass(frozen=True)
class TripodGeometry:
    """Place ``l0`` of the sliders at q = 410, long sides ``h``, azimuths ``theta``, each (3,)."""

    l0: Array
    h: Array
    theta: Array

    @property
    def along(self) -> Array:
        """Directions o_i of the sliders, (3, 3), one a row."""
        return np.stack([np.cos(self.theta), np.sin(self.theta), np.zeros(3)], axis=1)


def geometry(parameters: Mapping[str, float]) -> TripodGeometry:
    """Geometry from parameters ``limb1.l0`` ..."""

    def single(stem: str) -> Array:
        return np.array([parameters[f"{limb}.{stem}"] for limb in LIMBS])

    return TripodGeometry(single("l0"), single("h"), single("theta"))


def slider_places(g: TripodGeometry, position: Array) -> Array:
    """Places l_i (N, 3) of the sliders for positions (N, 3) of O'; NaN out of reach.

    l_i = b + r . o_i + sqrt(h_i^2 - z^2 - t_i^2), t_i = x sin theta_i - y cos theta_i.
    """
    x, y, z = position.T[:, :, None]
    across = x * np.sin(g.theta) - y * np.cos(g.theta)
    under = g.h**2 - z**2 - across**2
    reach = np.sqrt(np.where(under >= 0.0, under, np.nan))
    return np.asarray(B_MM + position @ g.along.T + reach)


def positions(g: TripodGeometry, places: Array, h: Array) -> Array:
    """Positions (N, 3) of O' for sliders at ``places`` (N, 3) with long sides ``h`` (N, 3).

    Raises ArithmeticError where the long sides do not meet.
    """
    along = g.along[:, :2]
    inner = places - B_MM
    centres = inner[:, :, None] * along
    square = inner**2 - h**2
    rows = 2.0 * (centres[:, 1:] - centres[:, :1])
    xy = np.linalg.solve(rows, (square[:, 1:] - square[:, :1])[:, :, None])[:, :, 0]
    under = h[:, 0] ** 2 - np.sum((xy - centres[:, 0]) ** 2, axis=1)
    if not np.all(under > 0.0):
        raise ArithmeticError("the long sides do not meet")
    return np.column_stack([xy, -np.sqrt(under)])
