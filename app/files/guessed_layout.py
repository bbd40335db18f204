"""How a text most likely holds a table: what a first map is begun with."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from app.files.foreign_layout import DELIMITERS, Layout
from app.files.foreign_numbers import parse_number
from app.files.foreign_table import AT_THE_END, ForeignTable, ends_with, table_of
from calib.errors import BadInput
from calib.plain_text import plain
from calib.units import UNITS, known_as

_COMMENTS = ("//", "#", "!", "%")
_MOST_LINES = 400
USUAL = 0.6
"""Part of the rows that hold a number in a column of numbers."""


def guessed_table(path: Path) -> tuple[ForeignTable, list[str]]:
    """Read a file as it is most likely laid out, and say what was taken for granted.

    Raises
    ------
    BadInput
        Where there is no table in it.
    """
    text, encoding = _text(path)
    lines = [line for line in text.split("\n")[:_MOST_LINES] if line.strip()]
    if not lines:
        raise BadInput(
            "the file is empty", place=f"{path}, line 1", remedy="Name a table with rows"
        )
    comments = tuple(
        sign for sign in _COMMENTS if any(line.lstrip().startswith(sign) for line in lines)
    )
    body = [line for line in lines if not line.lstrip().startswith(comments or ("\x00",))]
    layout = Layout(encoding=encoding, comments=comments, delimiter=_delimiter(body))
    layout = replace(layout, decimal=_decimal(body, layout))
    first = _first_row(text.split("\n"), layout)
    header = _has_names(text.split("\n")[first - 1] if first else "", layout)
    skip = max(0, first - (1 if header else 0))
    layout = replace(layout, header=header, skip=skip)
    layout = replace(layout, units_row=_has_units(text.split("\n"), layout))
    if layout.units_row:
        layout = replace(layout, header=True, skip=max(0, first - 2))
    layout = replace(layout, end=_end(text.split("\n")[first:], layout))
    said = [f"[file] {key}" for key in ("encoding", "delimiter", "decimal", "comments", "skip")]
    return table_of(text, layout, str(path)), said


def _text(path: Path) -> tuple[str, str]:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise BadInput(
            error.strerror or str(error), place=str(path), remedy="Name a file that can be read"
        ) from error
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return plain(raw.decode("utf-16", errors="replace")), "utf-16"
    if b"\x00" in raw:
        raise BadInput(
            "the file holds a zero byte: this is no text",
            place=str(path),
            remedy="Save the table as text (CSV)",
        )
    try:
        return plain(raw.decode("utf-8")), "utf-8"
    except UnicodeDecodeError:
        return plain(raw.decode("cp1252", errors="replace")), "cp1252"


def _delimiter(lines: list[str]) -> str:
    """The sign that parts most lines into the same number of cells."""
    best, score = "blanks", 0.0
    for name in ("tab", ";", "|", ",", "blanks"):
        sign = DELIMITERS[name]
        widths = Counter(len(line.split(sign)) if sign else len(line.split()) for line in lines)
        width, count = max(widths.items(), key=lambda pair: (pair[1], pair[0]))
        if width > 1 and count > score * 1.05:
            best, score = name, float(count)
    if best == "," and _most_numbers(lines, "blanks", ",") > _most_numbers(lines, ",", "."):
        return "blanks"  # these commas stand before decimals
    return best


def _most_numbers(lines: list[str], delimiter: str, decimal: str) -> int:
    """How many cells of lines so read are numbers."""
    layout = Layout(delimiter=delimiter, decimal=decimal)
    return sum(_numbers(line, layout) for line in lines)


def _cells(line: str, layout: Layout) -> list[str]:
    sign = DELIMITERS[layout.delimiter]
    cells = line.split(sign) if sign else line.split()
    return [cell.strip().strip('"') for cell in cells]


def _decimal(lines: list[str], layout: Layout) -> str:
    if layout.delimiter == ",":
        return "."
    commas = sum(
        bool(re.fullmatch(r"[+-]?\d+,\d+", c)) for line in lines for c in _cells(line, layout)
    )
    points = sum(
        bool(re.fullmatch(r"[+-]?\d+\.\d+", c)) for line in lines for c in _cells(line, layout)
    )
    return "," if commas > points else "."


def _numbers(line: str, layout: Layout) -> int:
    return sum(parse_number(cell, layout) is not None for cell in _cells(line, layout))


def _first_row(lines: list[str], layout: Layout) -> int:
    """How many lines come before the first row of numbers."""
    usual = Counter(
        len(_cells(line, layout)) for line in lines[:_MOST_LINES] if _numbers(line, layout) > 1
    )
    if not usual:
        raise BadInput(
            "no line of the file is a row of numbers",
            place="--guess",
            remedy="Write a map by hand (docs/import.md)",
        )
    width = usual.most_common(1)[0][0]
    for at, line in enumerate(lines):
        if not line.lstrip().startswith(layout.comments or ("\x00",)):
            cells = _cells(line, layout)
            if len(cells) == width and _numbers(line, layout) > max(1, width // 4):
                return at
    return 0


def _end(lines: Sequence[str], layout: Layout) -> str:
    """A pattern of the first line behind the rows, which says something of all; "" for none.

    A row has as many cells as most, and numbers where nearly all rows have them.
    """
    rows = [
        _cells(line, layout) for line in lines
        if line.strip() and not line.lstrip().startswith(layout.comments or ("\x00",))
    ]  # fmt: skip
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    whole = [cells for cells in rows if len(cells) == width]
    numeric = [
        sum(parse_number(cells[at], layout) is not None for cells in whole) > USUAL * len(whole)
        for at in range(width)
    ]
    behind = 0
    while behind < min(AT_THE_END, len(rows) - 1):
        cells = rows[-1 - behind]
        texts = (
            cell and parse_number(cell, layout) is None
            for cell, number in zip(cells, numeric, strict=False)
            if number
        )
        if len(cells) == width and not any(texts):
            break
        behind += 1
    if not behind:
        return ""
    end = ends_with(rows[-behind])
    earlier = (layout.delimiter.join(cells) for cells in rows[:-behind])
    return "" if not end or any(re.search(end, line) for line in earlier) else end


def _has_names(line: str, layout: Layout) -> bool:
    cells, remark = _cells(line, layout), line.lstrip().startswith(layout.comments or ("\x00",))
    return bool(line.strip()) and not remark and len(cells) > 1 and _numbers(line, layout) == 0


def _has_units(lines: list[str], layout: Layout) -> bool:
    """Whether what looks like the line of names is a line of units below another."""
    if not layout.header or layout.skip == 0:
        return False
    cells = [cell.strip("[]()") for cell in _cells(lines[layout.skip], layout)]
    units = sum(known_as(cell) in UNITS for cell in cells if cell)
    return units > 1 and units >= len([cell for cell in cells if cell]) // 2
