"""Numbers with units, as people write them in machine files: ``15 deg``, ``0.3 mm``."""

import math
import re

from calib.errors import BadInput

UNITS = {
    "mm": ("mm", 1.0),
    "um": ("mm", 1e-3),
    "m": ("mm", 1e3),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", math.pi / 180.0),
    "d": ("rad", math.pi / 180.0),
}
"""Unit -> (base unit, factor)."""

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"({_NUMBER})\s*([A-Za-z]*)")


def quantity(value: object, unit: str, place: str) -> float:
    """Value of a number, or of text with a unit, in ``unit`` (``"mm"`` or ``"rad"``; "" takes any).

    Raises
    ------
    BadInput
        If it is not a finite number, or its unit is unknown or measures something else.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise BadInput(
            f"{value!r} is not a number",
            place=place,
            remedy=f'Write 12.5 or "12.5 {unit or "mm"}".',
        )
    factor = 1.0
    if isinstance(value, str):
        found = _QUANTITY.fullmatch(value.strip())
        if not found:
            raise BadInput(
                f"{value!r} is not a number with a unit", place=place, remedy='Write "15 deg".'
            )
        number = float(found.group(1))
        if name := found.group(2):
            if name not in UNITS:
                raise BadInput(
                    f'unknown unit "{name}"', place=place, remedy=f"Known are {', '.join(UNITS)}."
                )
            base, factor = UNITS[name]
            if unit and base != unit:
                raise BadInput(
                    f'"{name}" does not measure what is asked for here',
                    place=place,
                    remedy=f"A value in {unit} is expected.",
                )
    else:
        number = float(value)
    if not math.isfinite(number):
        raise BadInput(f"{value!r} is not finite", place=place, remedy="Give a finite number.")
    return number * factor
