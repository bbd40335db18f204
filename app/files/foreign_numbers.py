"""Numbers as instruments and programs write them, in the signs that are stated of their file."""

import re

from app.files.foreign_layout import THOUSANDS, Layout
from calib.quantity import is_meant

_DIGITS = r"\d+"
_EXPONENT = r"(?:[eEdD][+-]?\d+)?"


def parse_number(cell: str, layout: Layout) -> float | None:
    """A finite number in the signs of ``layout``; None for everything else."""
    point, group = re.escape(layout.decimal), re.escape(layout.thousands)
    if group:
        grouped = rf"\d{{1,3}}(?:{group}\d{{3}})*" if layout.thousands in cell else _DIGITS
    else:
        grouped = _DIGITS
    found = re.fullmatch(
        rf"([+-]?)(?:({grouped})(?:{point}(\d*))?|{point}(\d+))({_EXPONENT})", cell
    )
    if found is None:
        return None
    sign, whole, decimals, only, exponent = found.groups()
    whole = (whole or "0").replace(layout.thousands, "") if layout.thousands else whole or "0"
    value = float(f"{sign}{whole}.{decimals or only or '0'}{exponent.lower().replace('d', 'e')}")
    return value if is_meant(value) else None


def number_remedy(cell: str, layout: Layout) -> str:
    """What to state of the file so that a cell would be a number, if there is such a thing."""
    for decimal in (".", ","):
        for thousands in THOUSANDS:
            other = Layout(decimal=decimal, thousands=thousands)
            if thousands != decimal and parse_number(cell, other) is not None:
                group = f' and thousands = "{thousands}"' if thousands else ""
                return (
                    f'Expected a number with "{layout.decimal}" before its decimals; if this is '
                    f'one, write decimal = "{decimal}"{group} under [file] of the map'
                )
    apart = next((one for one in (";", "\t", "|", ",") if one in cell), "")
    if apart and apart != layout.delimiter:
        name = "tab" if apart == "\t" else apart
        comma = ' and decimal = ","' if apart == ";" and layout.delimiter == "," else ""
        return (
            f'Expected a number; "{apart}" stands between the cells, it seems: write delimiter = '
            f'"{name}"{comma} under [file] of the map'
        )
    if not layout.header and re.fullmatch(r"[A-Za-z][\w .\[\]()/]*", cell):
        return (
            "Expected a number; if this is a line of names, write header = true under [file] of "
            "the map and name the columns by them, or skip = 1"
        )
    return "Expected a number, or nothing; what says that there is nothing stands under missing"
