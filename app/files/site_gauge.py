"""``[gauge]`` of a site file: an instrument that gives one number, instead of a tracker."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from app.devices import kind_named, kind_names
from app.files.device_settings import read_settings
from app.files.site_probe import Search, read_search
from calib.runs.sensing import Instrument, Plane
from calib.toml_table import TomlTable
from drivers.lines.number import ANGLES

Reads = Literal["direction", "distance", "tilt"]
READS: tuple[Reads, ...] = ("direction", "distance", "tilt")
CLEARANCE_MM = 5.0
NEAR = {"mm": 2.0, "rad": 0.02}
"""How far machine and drawing may be apart before a number is doubted, by its unit."""


@dataclass(frozen=True)
class GaugeSite:
    """Which gauge it is, and what it measures; lengths in mm, angles in rad.

    ``reads`` is the kind of its readings in the run; ``nest`` is where it is read, of a direction
    or a tilt; ``pairs`` those between which a distance is read. What is measured is ``zero_at`` +
    ``sign`` * what it shows; ``lowest`` and ``highest`` bound what it can show. ``clearance_mm``
    is how far the platform is lifted along ``away`` (3,), base frame, before it moves on; zero for
    none. ``near`` is how far a number may be from where the nominal machine expects it.
    ``search`` is there where it shows no number but only says whether it touches: what is measured
    is then ``zero_at``, the radius of its ball, wherever it touches.
    """

    kind: str
    serial: str
    settings: Mapping[str, Any]
    address: str
    name: str
    reads: Reads
    unit: str
    sigma: float
    instrument: Instrument
    plane: str
    nest: str
    pairs: tuple[tuple[str, str], ...]
    zero_at: float
    sign: int
    lowest: float
    highest: float
    near: float
    clearance_mm: float
    away: tuple[float, ...]
    search: Search | None = None

    @property
    def own_zero(self) -> bool:
        """Whether it begins at a zero of its own: only changes say something."""
        return (self.instrument.zero_sigma or 0.0) > self.near

    def zero_of(self, before: Sequence[tuple[float, float]]) -> float:
        """Its zero by what was read so far and what was expected of it."""
        off = [value - expected for value, expected in before]
        return float(np.median(off)) if off and self.instrument.zero_sigma is not None else 0.0

    @property
    def by_hand(self) -> bool:
        """Whether a person reads it off and types."""
        return self.kind == "operator"


def read_gauge(
    table: TomlTable,
    planes: Mapping[str, Plane],
    nests: tuple[Mapping[str, Any], Mapping[str, Any]],
    actuators: int | None,
    folder: Path,
) -> GaugeSite:
    """Check ``[gauge]``; ``nests`` are those of the platform and of the base.

    Raises
    ------
    BadInput
        With line and remedy for what cannot be.
    """
    name = table.choice("kind", kind_names("gauge"))
    kind = kind_named("gauge", name)
    settings = read_settings(table, kind, actuators, folder)
    serial = table.text("serial", "")
    reads = cast(Reads, table.choice("reads", READS))
    unit = "rad" if reads == "tilt" else "mm"
    if settings.get("unit") is not None and (settings["unit"] in ANGLES) != (unit == "rad"):
        table.complain(
            f'a {reads} is not in {settings["unit"]}', "unit",
            remedy=f"Write the unit of {'an angle: deg' if unit == 'rad' else 'a length: mm'}",
        )  # fmt: skip
    sigma = table.number("sigma", unit="mm or rad", above=0.0)
    plane, away = _touched(table, reads, planes)
    near = table.number("near", NEAR[unit], unit="mm or rad", above=0.0)
    search = read_search(table, reads, plane, near) if kind.tells == "contact" else None
    axis = table.numbers("axis", 3, (0.0, 0.0, 1.0)) if search is None else (0.0, 0.0, 1.0)
    instrument = Instrument(
        frame="base",
        axis=_direction(table, axis) if reads != "distance" and not plane else None,
        zero_sigma=table.optional_number("zero_sigma", unit="mm or rad", above=0.0),
        scale_sigma=table.optional_number("scale_sigma", above=0.0),
        model=table.text("model", name),
    )
    low, high = _range(table) if search is None else (-np.inf, np.inf)
    at, sign = (
        (table.number("zero_at", 0.0, unit="mm or rad"), _sign(table))
        if search is None
        else (search.radius_mm, 1)
    )
    own = GaugeSite(
        kind=name, serial=serial, settings=settings, address=kind.address(settings),
        name=table.text("name", "gauge"), reads=reads, unit=unit,
        sigma=sigma if search is None else float(np.hypot(sigma, search.spread_mm)),
        instrument=instrument, plane=plane, nest=_nest(table, reads, nests[0]),
        zero_at=at, sign=sign, pairs=_pairs(table, reads, *nests), lowest=low, highest=high,
        near=near, search=search,
        clearance_mm=table.number(
            "clearance_mm", CLEARANCE_MM if reads == "direction" else 0.0, unit="mm", least=0.0
        ),
        away=away if plane else tuple(axis),
    )  # fmt: skip
    table.end()
    return own


def _touched(
    table: TomlTable, reads: str, planes: Mapping[str, Plane]
) -> tuple[str, tuple[float, ...]]:
    """Which plane is touched, and its normal; empty for none."""
    plane = table.text("plane", "")
    if not plane:
        return "", ()
    if reads != "direction":
        table.complain(f"a {reads} touches no plane", "plane", remedy="Leave plane out")
        return "", ()
    if plane not in planes:
        table.complain(
            f'there is no plane "{plane}"', "plane",
            remedy=f"Add [planes.{plane}] with normal and through",
        )  # fmt: skip
        return "", ()
    if table.has("axis"):
        table.complain("it measures along the plane's normal", "axis", remedy="Leave axis out")
    return plane, tuple(float(one) for one in planes[plane].normal)


def _direction(table: TomlTable, axis: tuple[float, ...]) -> Any:
    vector = np.array(axis)
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > 1e-3:
        table.complain(
            f"axis has the length {length:.6g}", "axis", remedy="Expected a direction of length 1"
        )
        return np.array([0.0, 0.0, 1.0])
    return vector / length


def _range(table: TomlTable) -> tuple[float, float]:
    """What it can show."""
    low, high = (
        -np.inf if (one := table.optional_number("lowest", unit="mm or rad")) is None else one,
        np.inf if (one := table.optional_number("highest", unit="mm or rad")) is None else one,
    )
    if low >= high:
        table.complain(
            f"lowest is {low:g}, highest {high:g}: no number would ever be right", "lowest",
            remedy="Write the smallest and the largest number that it can show",
        )  # fmt: skip
    return low, high


def _nest(table: TomlTable, reads: str, platform: Mapping[str, Any]) -> str:
    """Nest at which it is read."""
    named = table.text("nest", "")
    if reads == "distance":
        if named:
            table.complain("a distance has pairs", "nest", remedy='Write pairs = ["p1 b1"]')
        return ""
    if named and named not in platform:
        table.complain(f'no platform nest "{named}"', "nest", remedy=_known(platform))
    if not named and reads == "direction" and len(platform) > 1:
        table.complain("nest is missing", "nest", remedy=f"Which one is read? {_known(platform)}")
    return named or next(iter(platform), "")


def _sign(table: TomlTable) -> int:
    sign = table.number("sign", 1.0)
    if abs(sign) != 1.0:
        table.complain(f"sign is {sign:g}", "sign", remedy="Write 1, or -1 where it counts down")
    return -1 if sign < 0.0 else 1


def _pairs(
    table: TomlTable, reads: str, platform: Mapping[str, Any], base: Mapping[str, Any]
) -> tuple[tuple[str, str], ...]:
    """Pairs of nests: those of the file, or each of the platform with each of the base."""
    texts = table.texts("pairs")
    if reads != "distance":
        if texts:
            table.complain(f"a {reads} has no pairs", "pairs", remedy="Leave pairs out")
        return ()
    found = []
    for text in texts:
        pair = tuple(text.split())
        if len(pair) != 2 or pair[0] not in platform or pair[1] not in base:
            table.complain(
                f'"{text}" is no pair of nests', "pairs",
                remedy=f'Write "NEST NEST", the first on the platform ({", ".join(platform)}), the '
                f"second on the base ({', '.join(base)})",
            )  # fmt: skip
        else:
            found.append((pair[0], pair[1]))
    return tuple(found) if texts else tuple((p, b) for p in platform for b in base)


def _known(nests: Mapping[str, Any]) -> str:
    return f"There are {', '.join(nests)}"
