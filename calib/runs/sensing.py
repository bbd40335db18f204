"""What a row of ``points.csv`` measures, where that is not the place of an SMR in three directions.

A reading holds up to three components (six for a pose: its place and its attitude). What is
missing of them is left empty in the file and carries no information.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = ("point", "direction", "distance", "angles", "tilt", "pose")
"""Kinds of readings; the index stands for the kind in arrays."""
POINT, DIRECTION, DISTANCE, ANGLES, TILT, POSE = range(6)
ANGULAR = (ANGLES, TILT)
"""Kinds whose components are angles in rad."""


@dataclass(frozen=True)
class Instrument:
    """What takes readings.

    Attributes
    ----------
    frame : "free" or "base"
        Whether it stands in a frame of its own, which the fit finds, or measures along the base's
        axes.
    near : (6,), optional
        Roughly where the base is in its frame: x, y, z in mm, rx, ry, rz in rad.
    axis : (3,)
        Direction of its readings of kind direction (its frame) or tilt (platform frame), unit.
    zero_sigma : float or None
        Standard deviation, mm or rad, of a constant that all its readings of one component share:
        only changes are measured. None: its zero is exact.
    scale_sigma : float or None
        Standard deviation of what its lengths are too long by, as a part of them. None: exact.
    """

    frame: str = "free"
    near: Array | None = None
    axis: Array | None = None
    zero_sigma: float | None = None
    scale_sigma: float | None = None
    model: str = ""


@dataclass(frozen=True)
class Plane:
    """A plane in the base frame that is touched.

    ``normal`` (3,) unit, to the side that is touched; ``through`` (3,) mm. ``sigma`` mm along the
    normal and ``tilt_sigma`` rad about two axes in it are of its prior; zero is exact.
    """

    normal: Array
    through: Array
    sigma: float = 0.0
    tilt_sigma: float = 0.0


@dataclass(frozen=True)
class Setup:
    """What version 2 of ``run.toml`` says beside version 1.

    ``nests`` has covariances (3, 3), mm^2, of the centres that are not exact.
    """

    instruments: Mapping[str, Instrument] = field(default_factory=dict)
    planes: Mapping[str, Plane] = field(default_factory=dict)
    nests: Mapping[str, Array] = field(default_factory=dict)

    def of(self, instrument: str) -> Instrument:
        """An instrument by its name; one of which nothing is said where it is not listed."""
        return self.instruments.get(instrument, Instrument())


@dataclass(frozen=True, eq=False)
class Sensing:
    """What each of N rows measures; moves without a reading have kind -1.

    Attributes
    ----------
    kind : (N,)
        Index in ``KINDS``.
    instrument, second, plane : tuple of N str
        Who measured; the other nest of a distance; the plane that was touched. Empty for none.
    ends : (2, N)
        Rows at which the two ends of a distance stood, for marks that were left at two poses; else
        -1.
    seen : (3, N) bool
        Components that the row holds: x, y, z; azimuth, elevation; one value.
    axis : (3, N)
        Direction, unit; zero where there is none.
    attitude : (3, 3, N)
        Of the platform in the instrument's frame, for poses; else the unit matrix.
    spread : (6, 6, N)
        Covariance of a pose: mm and rad about the instrument's axes; else zero.
    """

    kind: NDArray[np.intp]
    instrument: tuple[str, ...]
    second: tuple[str, ...]
    plane: tuple[str, ...]
    ends: NDArray[np.intp]
    seen: NDArray[np.bool_]
    axis: Array
    attitude: Array
    spread: Array
