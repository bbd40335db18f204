"""Units that people write beside numbers, and what they are in the program's own.

The program's own units are mm, rad, s, kg, deg C, N. ``x[in]`` in a header, ``unit = "degF"`` in
a map: the same words everywhere.
"""

import math
import re
from dataclasses import dataclass

from calib.errors import BadInput


@dataclass(frozen=True)
class Unit:
    """A unit: value in ``base`` = ``factor`` * number + ``zero``."""

    base: str
    factor: float
    zero: float = 0.0

    def convert(self, number: float) -> float:
        """The number in the base unit; as it stands where that is its own."""
        return number if self.factor == 1.0 and self.zero == 0.0 else (
            self.factor * number + self.zero
        )  # fmt: skip


_DEG = math.pi / 180.0
UNITS = {
    "mm": Unit("mm", 1.0),
    "um": Unit("mm", 1e-3),
    "cm": Unit("mm", 10.0),
    "m": Unit("mm", 1e3),
    "in": Unit("mm", 25.4),
    "ft": Unit("mm", 304.8),
    "rad": Unit("rad", 1.0),
    "mrad": Unit("rad", 1e-3),
    "deg": Unit("rad", _DEG),
    "arcmin": Unit("rad", _DEG / 60.0),
    "arcsec": Unit("rad", _DEG / 3600.0),
    "gon": Unit("rad", math.pi / 200.0),
    "turn": Unit("rad", 2.0 * math.pi),
    "s": Unit("s", 1.0),
    "ms": Unit("s", 1e-3),
    "min": Unit("s", 60.0),
    "h": Unit("s", 3600.0),
    "degC": Unit("degC", 1.0),
    "K": Unit("degC", 1.0, -273.15),
    "degF": Unit("degC", 5.0 / 9.0, -160.0 / 9.0),
    "kg": Unit("kg", 1.0),
    "g": Unit("kg", 1e-3),
    "lb": Unit("kg", 0.45359237),
    "N": Unit("N", 1.0),
    "kN": Unit("N", 1e3),
    "lbf": Unit("N", 4.4482216152605),
    "mm^2": Unit("mm^2", 1.0),
    "um^2": Unit("mm^2", 1e-6),
    "1": Unit("1", 1.0),
}
"""Every unit by its name."""
_ALIASES = {
    "µm": "um", "μm": "um", "micron": "um", "inch": "in", "inches": "in", '"': "in", "°": "deg",
    "degree": "deg", "degrees": "deg", "gradian": "gon", "grad": "gon", "rev": "turn", "sec": "s",
    "°C": "degC", "C": "degC", "deg C": "degC", "°F": "degF", "F": "degF", "deg F": "degF",
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "meter": "m", "meters": "m",
    "metre": "m", "radian": "rad", "radians": "rad", "mm2": "mm^2", "mm²": "mm^2", "um2": "um^2",
    "kelvin": "K", "-": "1",
}  # fmt: skip
_IN_HEADER = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))", re.DOTALL)


def unit_named(name: str, place: str, base: str = "") -> Unit:
    """The unit of that name; ``base`` is what it must measure ("" takes any).

    Raises
    ------
    BadInput
        If nobody knows it, or it measures something else.
    """
    unit = UNITS.get(known_as(name))
    fitting = [one for one, what in UNITS.items() if base in ("", what.base)]
    if unit is None:
        raise BadInput(
            f'unknown unit "{name}"', place=place, remedy=f"Known are {', '.join(fitting)}"
        )
    if base and unit.base != base:
        raise BadInput(
            f'"{name}" is no unit of what is measured here',
            place=place,
            remedy=f"Expected one of {', '.join(fitting)}",
        )
    return unit


def known_as(name: str) -> str:
    """The name under which a unit is kept, whether there is one or not."""
    name = name.strip()
    return _ALIASES.get(name, _ALIASES.get(name.lower(), name))


def split_header(cell: str) -> tuple[str, str]:
    """Name and unit of a column: ``x[mm]`` and ``T (degC)`` state one, ``x`` none.

    What stands in brackets and is no unit belongs to the name: ``J[1]``.
    """
    found = _IN_HEADER.fullmatch(cell.strip())
    if found is None:
        return cell.strip(), ""
    name, square, round_ = found.groups()
    unit = (square if square is not None else round_).strip()
    return (name, unit) if known_as(unit) in UNITS and unit != "1" else (cell.strip(), "")
