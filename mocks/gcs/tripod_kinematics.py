"""The tripod controller's own kinematics, in closed form (Feng et al. 2022, equation (3)).

Limb i slides along o_i = (cos theta_i, sin theta_i, 0); its long side h_i joins the slider at
l_i o_i with the platform at r + b o_i. The vertical plane of a limb contains q = r . o_i along the
slider and t = x sin(theta_i) - y cos(theta_i) across::

    l_i = b + q + sqrt(h_i^2 - z^2 - t^2)          inverse, slider outside the platform
    |r - (l_i - b) o_i|^2 = h_i^2                  forward, z < 0

What the operator commands is q_i = l_i - l0_i + 410: a slider that is told to stand at 410 really
stands at l0.
"""

import math
from collections.abc import Mapping, Sequence

HOME = 410.0
PLATFORM_RADIUS = 180.0
LIMBS = ("limb1", "limb2", "limb3")

Vector = tuple[float, float, float]


class Unreachable(Exception):
    """The limbs do not close there."""


def slider_places(position: Sequence[float], values: Mapping[str, float]) -> Vector:
    """Return the q (mm) of the three sliders that bring the platform to ``position`` (3,), mm.

    Raises :class:`Unreachable` if a long side is too short to reach its slider.
    """
    x, y, z = position
    places = []
    for limb in LIMBS:
        theta, h = values[f"{limb}.theta"], values[f"{limb}.h"]
        cos, sin = math.cos(theta), math.sin(theta)
        rest = h * h - z * z - (x * sin - y * cos) ** 2
        if rest < 0.0:
            raise Unreachable(limb)
        place = PLATFORM_RADIUS + x * cos + y * sin + math.sqrt(rest)
        places.append(place - values[f"{limb}.l0"] + HOME)
    return places[0], places[1], places[2]


def position_of(places: Sequence[float], values: Mapping[str, float]) -> Vector:
    """Return the position (3,) in mm of the platform whose sliders stand at q = ``places`` (3,).

    The differences of the three spheres are linear in x and y. Raises :class:`Unreachable` where
    the spheres do not meet below the sliders.
    """
    centres = []
    for limb, q in zip(LIMBS, places, strict=True):
        along = q + values[f"{limb}.l0"] - HOME - PLATFORM_RADIUS
        theta, h = values[f"{limb}.theta"], values[f"{limb}.h"]
        centres.append((along * math.cos(theta), along * math.sin(theta), h))
    (x0, y0, h0), *others = centres
    rows = [
        (2 * (x - x0), 2 * (y - y0), x * x + y * y - h * h - x0 * x0 - y0 * y0 + h0 * h0)
        for x, y, h in others
    ]
    (a, b, e), (c, d, f) = rows
    determinant = a * d - b * c
    if determinant == 0.0:
        raise Unreachable("parallel limbs")
    px, py = (e * d - b * f) / determinant, (a * f - e * c) / determinant
    rest = h0 * h0 - (px - x0) ** 2 - (py - y0) ** 2
    if rest < 0.0:
        raise Unreachable("too far apart")
    return px, py, -math.sqrt(rest)
