"""One number in a line: a dial gauge, a probe, a ball bar, an inclinometer."""

import math
import re
from dataclasses import dataclass

from drivers.lines.patience import LONGEST, slow_on
from drivers.lines.reading import NUMBER

LENGTHS = {"mm": 1.0, "um": 1e-3, "m": 1e3, "in": 25.4}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "arcsec": math.pi / 648_000.0}
UNITS = LENGTHS | ANGLES
"""mm, or rad, in one unit."""
SAID = {"inch": "in", '"': "in", "µm": "um", "μm": "um", "âµm": "um", "°": "deg", "â°": "deg"}
"""Other words for a unit that instruments send, in Latin-1 and in UTF-8 read as such."""
LARGEST = 1e7
"""No gauge reads more, mm or rad."""
PLAIN = rf"\s*(?:\d\d[A-Z])?(?P<value>{NUMBER})\s*(?P<unit>[A-Za-z\"°µμÂ]+)?\s*"
"""A number, perhaps behind two digits and a letter (Digimatic), perhaps with its unit."""


def fault_in(pattern: str) -> str:
    """What is wrong with a pattern, in words; "" if nothing."""
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        return f"no pattern: {error}"
    return slow_on(compiled) if "value" in compiled.groupindex else "no group (?P<value>...)"


@dataclass(frozen=True)
class Number:
    """A number in mm or rad, the unit that it was in, and the line."""

    value: float
    unit: str
    line: str


class NumberPattern:
    """Lines of one gauge.

    Parameters
    ----------
    pattern : str
        Of a whole line, with a group ``value``, and ``unit`` where lines have one.
    unit : str
        Of lines without one, a key of :data:`UNITS`; those of the other sort (an angle for a
        length) hold no number.
    decimal : str
        Sign before decimals.
    ignore : str
        Lines in which this is found say nothing; "" for none.
    """

    def __init__(self, pattern: str, unit: str, decimal: str, ignore: str) -> None:
        self._pattern = re.compile(pattern)
        self._tells_unit = "unit" in self._pattern.groupindex
        self._unit, self._decimal = unit, decimal
        self._sort = LENGTHS if unit in LENGTHS else ANGLES
        self._ignore = re.compile(ignore) if ignore else None

    def ignores(self, line: str) -> bool:
        """Whether a line says nothing."""
        return not line.strip() or bool(self._ignore and self._ignore.search(line[:LONGEST]))

    def read(self, line: str) -> Number | None:
        """The number in a line; None where there is none."""
        text = line.replace(self._decimal, ".") if self._decimal != "." else line
        found = self._pattern.fullmatch(text) if len(text) <= LONGEST else None
        if found is None:
            return None
        said = (found["unit"] or "").strip() if self._tells_unit else ""
        unit = SAID.get(said.lower(), said.lower()) if said else self._unit
        if unit not in self._sort:
            return None
        try:
            value = self._sort[unit] * float(found["value"])
        except (TypeError, ValueError):
            return None
        return Number(value, unit, line.strip()) if abs(value) <= LARGEST else None
