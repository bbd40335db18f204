"""A way in which a run may have been written, and ways of writing points that are no unit alone."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.runs.record import Run

FARTHEST_DEG = 400.5
"""Largest number of an angle, in deg or gon."""


@dataclass(frozen=True, eq=False)
class Way:
    """One way in which a run may have been written: ``run`` reads it so.

    ``resized``: in another unit of length.
    """

    of: str
    says: str
    remedy: str
    run: Run
    resized: bool = False


def of_one_axis(run: Run) -> Iterator[Way]:
    """One of x, y, z in m, in um or in inches, the other two in mm."""
    for axis, name in enumerate("xyz"):
        for factor, unit in ((1000.0, "m"), (0.001, "um"), (25.4, "inches")):
            scale = np.ones((3, 1))
            scale[axis] = factor
            yield Way(
                "position",
                f"{name} looks like {unit}, the other two of x, y, z are in mm",
                f"Write {name} in mm (these numbers times {factor:g})",
                replace(run, position=scale * run.position),
            )


def of_angles(run: Run) -> Iterator[Way]:
    """Two angles and a distance in the columns x, y, z, as instruments show them."""
    read = run.position[:, run.measured]
    for far, order in ((2, "angles, then distance"), (0, "distance, then angles")):
        first, second = [axis for axis in range(3) if axis != far]
        largest = float(np.abs(read[[first, second]]).max(initial=0.0))
        distance = float(np.median(read[far])) if read.size else 0.0
        if distance <= 0.0 or largest > min(FARTHEST_DEG, 0.9 * distance):
            continue
        for turn, unit in _angle_units(largest):
            around, up = turn * run.position[first], turn * run.position[second]
            for of_zenith in (True, False):
                for clockwise in (False, True):
                    yield Way(
                        "position",
                        f"x, y, z are no coordinates: they look like {order}, in {unit}",
                        "Write Cartesian x, y, z in mm; pkmcal import reads angles and distances",
                        replace(
                            run,
                            position=_cartesian(
                                run.position[far], -around if clockwise else around, up,
                                of_zenith=of_zenith,
                            ),
                        ),
                    )  # fmt: skip


def _angle_units(largest: float) -> list[tuple[float, str]]:
    if largest < 2.0 * np.pi + 0.01:
        return [(1.0, "rad"), (np.pi / 180.0, "deg")]
    return [(np.pi / 180.0, "deg"), (np.pi / 200.0, "gon")]


def _cartesian(distance: Array, around: Array, up: Array, *, of_zenith: bool) -> Array:
    height = np.cos(up) if of_zenith else np.sin(up)
    level = np.sin(up) if of_zenith else np.cos(up)
    return np.asarray(distance * np.stack([level * np.cos(around), level * np.sin(around), height]))
