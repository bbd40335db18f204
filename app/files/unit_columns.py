"""Tables of numbers with units: in the head of a column, or behind a number.

A head is a name, and a unit where it is not mm or rad: ``x``, ``rx [deg]``, ``rx (deg)``,
``rx_deg``. A cell is a number in that unit, or brings its own: ``12.5 deg``. Nothing is guessed.
"""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.files.text import read_text
from calib.errors import BadInput
from calib.quantity import LARGEST, UNITS, in_short, is_meant, is_quantity, quantity

_HEAD = re.compile(r"(?P<name>[^\[\]()]*+)(?:[\[(]\s*(?P<unit>[A-Za-z]+)\s*[\])])?\s*")


@dataclass(frozen=True)
class Column:
    """A column: its name, what it measures (mm or rad; "" for a label), factor to that unit."""

    name: str
    measures: str = ""
    factor: float = 1.0

    def number(self, cell: str, place: str) -> float:
        """A cell in mm or rad; raises BadInput for what is no finite number of that kind."""
        where = f"{place}, column {self.name}"
        if self.measures and is_quantity(cell) and any(map(str.isalpha, cell[-1:])):
            return quantity(cell, self.measures, where)
        return number_in(cell, where) * self.factor


def number_in(cell: str, place: str) -> float:
    """A number that can be meant; raises BadInput for anything else, a unit behind it included."""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not is_meant(value):
        raise BadInput(
            f"{in_short(cell)} is not a finite number",
            place=place,
            remedy=f"Write a number within -{LARGEST:g} and {LARGEST:g}",
        )
    return value


def column(head: str, measures: dict[str, str], place: str) -> Column:
    """Read the head of a column; ``measures`` names the columns that hold mm or rad.

    Raises
    ------
    BadInput
        For a unit that is not known, or measures something else. A name that ``measures`` lacks
        is a column without unit, whatever it is called.
    """
    found = _HEAD.fullmatch(head.strip())
    name, unit = (found["name"].strip(), found["unit"]) if found else (head.strip(), None)
    if unit is None and name not in measures:
        short, _, behind = name.rpartition("_")
        if short in measures and behind in UNITS:
            name, unit = short, behind
    kind = measures.get(name, "")
    if unit is None or not kind:
        return Column(name if kind else head.strip(), kind)
    base, factor = UNITS.get(unit, ("", 0.0))
    if base != kind:
        known = ", ".join(u for u, (b, _) in UNITS.items() if b == kind)
        raise BadInput(
            f'the unit "{unit}" of column {name}', place=place, remedy=f"Write one of {known}"
        )
    return Column(name, kind, factor)


def table_lines(path: Path) -> Iterator[tuple[str, Sequence[str]]]:
    """Rows of a CSV file with their places; empty lines and those that start with # are remarks.

    Raises BadInput for a cell that is longer than any can be.
    """
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if line.strip() and not line.startswith("#"):
            place = f"{path}, line {number}"
            try:
                yield place, [cell.strip() for cell in next(csv.reader([line]))]
            except csv.Error as error:
                raise BadInput(
                    f"not readable as comma-separated values: {error}",
                    place=place,
                    remedy="Look for a line that is two, or a quotation mark",
                ) from error
