"""``points.csv`` as sheets and other programs spell it, brought to the plain spelling.

Semicolons or tabs between columns, with or without decimal commas; Excel's first line ``sep=;``;
units in the header (``x[in]``) or in a row below it; a column ``time`` of ISO 8601; empty columns
at the end. A text that has none of these is handed on untouched, so that it is read as ever. Lines
keep their numbers. What could be read in two ways is refused.
"""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from calib.errors import BadInput
from calib.plain_text import plain
from calib.units import UNITS, Unit, known_as, unit_named

_UNIT = re.compile(r"(.*\S)\s*\[([^\[\]]*)\]")
_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?")
_POINT = re.compile(r"[+-]?(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?")
_BOTH = re.compile(r"[+-]?\d{1,3}(?:([., ' ])\d{3})(?:\1\d{3})*[.,]\d*")
_SEP = re.compile(r"sep=(.)\s*", re.IGNORECASE)
_ISO = re.compile(
    r"(\d{4})-?(\d\d)-?(\d\d)[T ](\d\d):?(\d\d)(?::?(\d\d(?:[.,]\d+)?))?"
    r"(Z|[+-]\d\d(?::?\d\d)?)?"
)
_LABELS = ("pose", "nest", "kind", "instrument", "nest2", "plane", "pose2")
_BASES = (
    (r"[xyz]|s[xyz]", "mm"), (r"s(xy|xz|yz)", "mm^2"), (r"time_s|delay_s", "s"), (r".*_C", "degC"),
    (r".*_kg", "kg"), (r"s?(azimuth|elevation|rx|ry|rz)", "rad"),
)  # fmt: skip
TIME = "time"
"""Column of dates and times, in place of ``time_s``."""


@dataclass(frozen=True)
class _Sheet:
    """Rows with the line on which each ends; ``header`` the first of them."""

    source: str
    rows: list[tuple[int, list[str]]]
    names: list[str]
    units: list[str]

    def place(self, line: int, column: int) -> str:
        return f"{self.source}, line {line}, column {self.names[column] or column + 1}"


def spelled(text: str, source: str, actuator_units: Sequence[str] = ()) -> str:
    """The same table in the plain spelling.

    Parameters
    ----------
    text : str
    source : str
        For messages.
    actuator_units : sequence of str, optional
        "mm" or "rad" of each actuator, against which units of q1, q2 .. are checked.

    Raises
    ------
    BadInput
        With line and column, for a unit that nobody knows or that measures something else, a number
        that could be read in two ways, and a time that is none.
    """
    text = plain(text)
    lines = text.split("\n")
    first = next((at for at, line in enumerate(lines) if line.strip()), None)
    if first is None:
        return text
    delimiter, first = _delimiter(lines, first)
    header = lines[first]
    named = [cell.strip() for cell in header.split(delimiter)]
    strange = delimiter != "," or first or any("[" in cell for cell in named)
    below = _units_below(lines[first + 1 :], delimiter)
    if not (strange or below or TIME in named or not named[-1]):
        return text
    sheet = _sheet(lines, first, delimiter, source, below=below)
    return _plainly(sheet, len(lines), actuator_units, comma=delimiter != "," and _commas(sheet))


def _delimiter(lines: Sequence[str], first: int) -> tuple[str, int]:
    """What stands between columns, and where the header is."""
    said = _SEP.fullmatch(lines[first])
    if said and first + 1 < len(lines):
        return said.group(1), first + 1
    signs = [sign for sign in (";", "\t") if sign in lines[first]]
    return (signs[0] if signs and "," not in lines[first] else ","), first


def _units_below(lines: Sequence[str], delimiter: str) -> bool:
    """Whether the row below the header holds units and nothing else."""
    row = next((line for line in lines if line.strip()), "")
    cells = [cell.strip().strip("[]()") for cell in row.split(delimiter)]
    filled = [cell for cell in cells if cell]
    return len(filled) > 2 and all(known_as(cell) in UNITS for cell in filled) and not any(
        cell[:1].isdigit() for cell in filled
    )  # fmt: skip


def _sheet(lines: Sequence[str], first: int, delimiter: str, source: str, *, below: bool) -> _Sheet:
    reader = csv.reader((line + "\n" for line in lines[first:]), delimiter=delimiter, strict=True)
    rows: list[tuple[int, list[str]]] = []
    try:
        rows.extend(
            (reader.line_num + first, cells) for cells in reader if any(map(str.strip, cells))
        )
    except csv.Error as error:
        raise BadInput(
            f"not readable as separated values: {error}",
            place=f"{source}, line {min(reader.line_num + first, len(lines))}",
            remedy="Look for a quotation mark that is not closed, or a truncated line",
        ) from error
    width = max(
        (at + 1 for _, cells in rows for at, cell in enumerate(cells) if cell.strip()), default=0
    )
    rows = [(line, cells[: max(width, 1)]) for line, cells in rows]
    found = [_UNIT.fullmatch(cell.strip()) for cell in rows[0][1]]
    names = [
        one.group(1) if one else cell.strip() for one, cell in zip(found, rows[0][1], strict=True)
    ]
    units = [one.group(2).strip() if one else "" for one in found]
    if below:
        stated = [cell.strip().strip("[]()") for cell in rows.pop(1)[1]]
        units = [own or one for own, one in zip(units, stated, strict=False)]
        units += [""] * (len(names) - len(units))
    return _Sheet(source, rows, names, units)


def _commas(sheet: _Sheet) -> bool:
    """Whether decimals stand behind commas."""
    return any(_COMMA.fullmatch(cell) for _, _, cell in _numbers(sheet))


def _numbers(sheet: _Sheet) -> Iterator[tuple[int, int, str]]:
    """Line, column and text of every cell that is no label."""
    for line, cells in sheet.rows[1:]:
        for column, cell in enumerate(cells[: len(sheet.names)]):
            if sheet.names[column] not in _LABELS:
                yield line, column, cell.strip()


def _plainly(sheet: _Sheet, count: int, actuator_units: Sequence[str], *, comma: bool) -> str:
    """The text of a sheet in the plain spelling, line for line."""
    units = [_unit(sheet, column, actuator_units) for column in range(len(sheet.names))]
    names = list(sheet.names)
    moments: dict[int, float] = {}
    if TIME in names and "time_s" not in names:
        moments = _moments(sheet, names.index(TIME))
        names[names.index(TIME)] = "time_s"
    lines = [""] * count
    lines[sheet.rows[0][0] - 1] = _joined(names)
    for line, cells in sheet.rows[1:]:
        written = []
        for column, cell in enumerate(cells):
            inside = column < len(names) and sheet.names[column] not in _LABELS
            if inside and line in moments and sheet.names[column] == TIME:
                written.append(repr(moments[line]))
            elif inside:
                place = sheet.place(line, column)
                written.append(_converted(_pointed(cell.strip(), comma, place), units[column]))
            else:
                written.append(cell)
        lines[line - 1] = _joined(written)
    return "\n".join(lines)


def _unit(sheet: _Sheet, column: int, actuator_units: Sequence[str]) -> Unit | None:
    """The unit that a column states; None for none."""
    stated, name = sheet.units[column], sheet.names[column]
    if not stated:
        return None
    base = next((base for pattern, base in _BASES if re.fullmatch(pattern, name)), "")
    actuator = re.fullmatch(r"q([1-9]\d*)", name)
    if actuator and int(actuator[1]) <= len(actuator_units):
        base = actuator_units[int(actuator[1]) - 1]
    return unit_named(stated, sheet.place(sheet.rows[0][0], column), base)


def _pointed(cell: str, comma: bool, place: str) -> str:
    """A number with a point before its decimals; text as it stands."""
    if _BOTH.fullmatch(cell) and ("," in cell) and ("." in cell or not comma):
        raise BadInput(
            f"found {cell!r}", place=place,
            remedy="Expected a number without signs between its thousands",
        )  # fmt: skip
    if not comma:
        return cell
    if _POINT.fullmatch(cell):
        raise BadInput(
            f"found {cell!r}, where other numbers have a comma before their decimals",
            place=place,
            remedy="Expected one sign before decimals in the whole file",
        )
    return cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell


def _converted(cell: str, unit: Unit | None) -> str:
    if unit is None or not cell or "_" in cell:
        return cell
    try:
        return repr(unit.convert(float(cell)))
    except ValueError:
        return cell


def _joined(cells: Sequence[str]) -> str:
    return ",".join(
        '"' + cell.replace('"', '""') + '"' if re.search(r'[",\n]', cell) else cell
        for cell in cells
    )


def _moments(sheet: _Sheet, column: int) -> dict[int, float]:
    """Seconds from the first row, by line; raises BadInput for what is no date and time."""
    found: dict[int, float] = {}
    zoned: set[bool] = set()
    for line, cells in sheet.rows[1:]:
        cell = cells[column].strip() if column < len(cells) else ""
        match = _ISO.fullmatch(cell)
        if match is None or not _is_date(match):
            raise BadInput(
                f"found {cell!r}", place=sheet.place(line, column),
                remedy="Expected ISO 8601, as 2024-05-31T14:05:06.5+02:00; or time_s in seconds",
            )  # fmt: skip
        zoned.add(match[7] is not None)
        if len(zoned) > 1:
            raise BadInput(
                f"found {cell!r}: some times state a zone and some do not",
                place=sheet.place(line, column),
                remedy="State the zone everywhere, or nowhere",
            )
        found[line] = _seconds(match)
    begin = next(iter(found.values()), 0.0)
    return {line: round(value - begin, 6) for line, value in found.items()}


def _is_date(match: re.Match[str]) -> bool:
    year, month, day, hour, minute = (int(match[k]) for k in range(1, 6))
    leap = year % 4 == 0 and (year % 100 != 0 or year % 400 == 0)
    longest = (31, 29 if leap else 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)
    if not (1 <= month <= 12 and 1 <= day <= longest[month - 1]):
        return False
    return hour < 24 and minute < 60 and float((match[6] or "0").replace(",", ".")) < 61.0


def _seconds(match: re.Match[str]) -> float:
    """Seconds of the proleptic Gregorian calendar: days by whole months that begin with March."""
    year, month, day, hour, minute = (int(match[k]) for k in range(1, 6))
    year, month = (year, month - 3) if month > 2 else (year - 1, month + 9)
    days = 365 * year + year // 4 - year // 100 + year // 400 + (153 * month + 2) // 5 + day
    seconds = float((match[6] or "0").replace(",", "."))
    zone = match[7] or "Z"
    away = 0
    if zone != "Z":
        digits = zone[1:].replace(":", "")
        away = (1 if zone[0] == "+" else -1) * (int(digits[:2]) * 60 + int(digits[2:] or "0"))
    return 86400.0 * days + 3600.0 * hour + 60.0 * (minute - away) + seconds
