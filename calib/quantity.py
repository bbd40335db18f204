"""Numbers with units, as people write them in machine files: ``15 deg``, ``5 mm/turn``."""

import math
import re
from collections.abc import Iterable

from calib.errors import BadInput

LARGEST = 1e12
"""Bound of every number of every file: no length in mm, time in s or count beyond it is meant."""

LONGEST_SHOWN = 80

UNITS = {
    "mm": ("mm", 1.0),
    "um": ("mm", 1e-3),
    "m": ("mm", 1e3),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", math.pi / 180.0),
    "d": ("rad", math.pi / 180.0),
    "turn": ("rad", 2.0 * math.pi),
}
"""Unit -> (base unit, factor)."""

_NUMBER = r"[+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?"
_QUANTITY = re.compile(rf"({_NUMBER})\s*(?:([A-Za-z]+)(?:\s*/\s*({_NUMBER})?\s*([A-Za-z]+))?)?")


def is_meant(value: float) -> bool:
    """Whether a number can be meant: it is neither nan nor beyond :data:`LARGEST`."""
    return abs(value) <= LARGEST


def is_quantity(text: str) -> bool:
    """Whether a text begins like a number and any unit of it is known; a name may too: ``0dx1``."""
    found = _QUANTITY.fullmatch(text)
    return found is not None and all(u is None or u in UNITS for u in found.group(2, 4))


def quantity(value: object, unit: str, place: str) -> float:
    """Value of a number, or of text with a unit, in ``unit`` (``"mm"`` or ``"rad"``; "" takes any).

    Raises
    ------
    BadInput
        If it is not a finite number, or its unit is unknown or measures something else.
    """
    number, own = measured(value, place, unit or "mm")
    if unit and own not in ("", unit):
        raise BadInput(
            f"{value!r} does not measure what is asked for here",
            place=place,
            remedy=f"A value in {unit} is expected.",
        )
    return number


def measured(value: object, place: str, like: str = "mm") -> tuple[float, str]:
    """A number and its unit: "mm", "rad", "mm/rad", "rad/mm"; "" for a bare number.

    Raises
    ------
    BadInput
        If it is not a finite number, or its unit is unknown; ``like`` is the unit of the example.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise BadInput(
            f"{value!r} is not a number", place=place, remedy=f'Write 12.5 or "12.5 {like}".'
        )
    try:
        number, unit = (float(value), "") if not isinstance(value, str) else _parsed(value, place)
    except OverflowError:  # a whole number of hundreds of digits
        number, unit = math.inf, ""
    if not is_meant(number):
        raise BadInput(
            f"{in_short(value)} is not finite, or beyond every number that can be meant",
            place=place,
            remedy=f"Give a number within -{LARGEST:g} and {LARGEST:g}.",
        )
    return number, unit


def in_short(value: object) -> str:
    """A value as it is written, cut where that would be long."""
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]} ..."


def _parsed(text: str, place: str) -> tuple[float, str]:
    found = _QUANTITY.fullmatch(text.strip())
    if not found:
        raise BadInput(
            f"{text!r} is not a number with a unit", place=place, remedy='Write "15 deg".'
        )
    number, units = float(found.group(1)), []
    if found.group(2):
        base, factor = _unit(found.group(2), place)
        number, units = number * factor, [base]
    if found.group(4):
        base, factor = _unit(found.group(4), place)
        below = factor * float(found.group(3) or 1.0)
        number = number / below if below else math.inf
        units.append(f"1/{base}")
    return number, product_unit(units)


def _unit(name: str, place: str) -> tuple[str, float]:
    if name not in UNITS:
        raise BadInput(
            f'unknown unit "{name}"', place=place, remedy=f"Known are {', '.join(UNITS)}."
        )
    return UNITS[name]


def product_unit(units: Iterable[str]) -> str:
    """Unit of a product: of ``mm/rad`` and ``rad`` it is ``mm``, "" where all cancels."""
    powers = {"mm": 0, "rad": 0}
    for unit in units:
        above, _, below = unit.partition("/")
        for name, sign in ((above, 1), (below, -1)):
            if name in powers:
                powers[name] += sign
    above = "*".join(name for name, power in powers.items() for _ in range(power))
    below = "*".join(name for name, power in powers.items() for _ in range(-power))
    return f"{above or 1}/{below}" if below else above
