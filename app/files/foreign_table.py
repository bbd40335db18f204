"""Tables as instruments and programs write them: cells with the line on which each row stands.

How the text is laid out is stated, never guessed: encoding, delimiter, decimal sign, lines that are
none of the table's. What does not fit is named with line and column.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from app.files.foreign_layout import DELIMITERS, Layout
from app.files.foreign_lines import decoded, lines_of, split
from app.files.foreign_numbers import number_remedy, parse_number
from calib.errors import BadInput
from calib.units import split_header

Column = str | int
"""A column by its name, or by its number from 1 on."""
AT_THE_END = 12
"""Lines at the end of a file that may be no rows but what a program says of all of them."""


@dataclass(frozen=True)
class ForeignTable:
    """The cells of a file.

    ``names`` and ``units`` are empty texts where the file states none; ``lines`` the line of each
    row (the file's first is 1).
    """

    source: str
    layout: Layout
    names: tuple[str, ...]
    units: tuple[str, ...]
    lines: tuple[int, ...]
    rows: tuple[tuple[str, ...], ...]
    header_line: int = 0
    notes: tuple[str, ...] = field(default=())

    def index(self, column: Column, place: str) -> int:
        """Where a column stands, from 0 on; raises BadInput naming what there is."""
        if isinstance(column, int):
            if 1 <= column <= self.width:
                return column - 1
            raise BadInput(
                f"there is no column {column}: {self.source} has {self.width}", place=place,
                remedy="Columns are counted from 1 on",
            )  # fmt: skip
        found = [at for at, name in enumerate(self.names) if name == column]
        if len(found) == 1:
            return found[0]
        if len(found) > 1:
            raise BadInput(
                f'{self.source} has {len(found)} columns "{column}"', place=place,
                remedy=f"Name them by number: {', '.join(str(at + 1) for at in found)}",
            )  # fmt: skip
        there = ", ".join(name or str(at + 1) for at, name in enumerate(self.names)) or "no names"
        raise BadInput(
            f'{self.source} has no column "{column}"', place=place, remedy=f"There are: {there}"
        )

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.names)

    def column_name(self, at: int) -> str:
        """What a column is called in messages."""
        return self.names[at] or str(at + 1)

    def place(self, row: int, at: int) -> str:
        """File, line and column of a cell, for messages."""
        return f"{self.source}, line {self.lines[row]}, column {self.column_name(at)}"

    def text(self, row: int, at: int) -> str:
        """A cell, without the blanks around it; "" where it says that there is nothing."""
        cell = self.rows[row][at].strip()
        return "" if cell in self.layout.missing else cell

    def number(self, row: int, at: int) -> float:
        """A number as the file writes it, nan where there is none.

        Raises
        ------
        BadInput
            For text, and for a number that could be read in two ways.
        """
        cell = self.text(row, at)
        if not cell or cell.lower() in ("nan", "+nan", "-nan"):
            return math.nan
        value = parse_number(cell, self.layout)
        if value is None:
            late = row >= max(1, len(self.rows) - AT_THE_END)
            raise BadInput(
                f"found {cell!r}",
                place=self.place(row, at),
                remedy=number_remedy(cell, self.layout)
                + (_ends_before(self.rows[row]) if late else ""),
            )
        return value


def read_foreign(path: Path, layout: Layout) -> ForeignTable:
    """Read a file as it is laid out.

    Raises
    ------
    BadInput
        With file, line and column, for what does not fit the layout.
    """
    return table_of(decoded(path, layout.encoding), layout, str(path))


def table_of(text: str, layout: Layout, source: str) -> ForeignTable:
    """The table in a text, see :func:`read_foreign`."""
    kept, notes = lines_of(text, layout, source)
    return _with_header(split(kept, layout, source), layout, source, notes)


def ends_with(cells: Sequence[str]) -> str:
    """A pattern of lines that begin as this one does; empty where it begins with no word."""
    word = next((cell.strip() for cell in cells if cell.strip()), "")
    begin = re.match(r"[^\W\d_][^\s:;,=|]*", word)
    return "" if begin is None else rf"^\W*{re.escape(begin[0])}"


def _ends_before(cells: Sequence[str]) -> str:
    """What to write where the table ends before such a line; empty where it begins no text."""
    end = ends_with(cells)
    return f"; if the table ends before it, write end = '{end}' under [file]" if end else ""


def _with_header(
    rows: list[tuple[int, list[str]]], layout: Layout, source: str, notes: list[str]
) -> ForeignTable:
    header_line, names, units = 0, [], []
    said: list[str] = []
    if layout.header:
        if not rows:
            raise BadInput("there is no line of names", place=source, remedy="See skip and after")
        (header_line, said), *rows = rows
        names, units = map(list, zip(*(split_header(cell) for cell in said), strict=True))
    if layout.units_row and rows:
        (_, stated), *rows = rows
        stated = [cell.strip().strip("[]()").strip() for cell in stated]
        units = [own or one for own, one in zip(_padded(units, len(stated)), stated, strict=False)]
    if not rows:
        raise BadInput(
            "the file holds no row of the table",
            place=f"{source}, line {header_line + 1}",
            remedy="Check skip, after and end under [file] of the map",
        )
    width = layout.fields or (len(names) if layout.header else len(rows[0][1]))
    if width == 1 and layout.header and (other := _other_delimiter(names[0])):
        raise BadInput(
            f'the whole line of names is one column; it holds "{other}"',
            place=f"{source}, line {header_line}",
            remedy=f'Write delimiter = "{other}" under [file] of the map',
        )
    dropped = 0
    if not layout.fields:
        width, dropped = _without_empty(rows, names, width)
    notes += [f"{dropped} columns at the end are empty and left out"] * bool(dropped)
    names, units = names[:width], units[:width]
    for number, (line, cells) in enumerate(rows):
        if said and cells == said[: len(cells)] and any(cell.strip() for cell in cells):
            raise BadInput(
                f"the names of line {header_line} come again",
                place=f"{source}, line {line}",
                remedy="These are two tables: give each a file of its own, or delete this line",
            )
        if len(cells) != width:
            late = number >= max(1, len(rows) - AT_THE_END)
            raise _wrong_width(line, cells, width, layout, source, _ends_before(cells) * late)
    return ForeignTable(
        source,
        layout,
        tuple(_padded(names, width)),
        tuple(_padded(units, width)),
        tuple(line for line, _ in rows),
        tuple(tuple(cells) for _, cells in rows),
        header_line,
        tuple(notes),
    )


def _padded(cells: Sequence[str], width: int) -> list[str]:
    return [*cells, *[""] * (width - len(cells))]


def _without_empty(
    rows: list[tuple[int, list[str]]], names: list[str], width: int
) -> tuple[int, int]:
    """Cut cells beyond the last column that has a name or a number anywhere; (width, cut)."""
    last = max((at + 1 for at, name in enumerate(names) if name), default=0)
    if not names:
        last = 0
    for _, cells in rows:
        filled = max((at + 1 for at, cell in enumerate(cells) if cell.strip()), default=0)
        last = max(last, filled)
    kept = min(width, last) if last else width
    for _, cells in rows:
        while len(cells) > kept and not cells[-1].strip():
            cells.pop()
    return kept, width - kept


def _other_delimiter(line: str) -> str:
    """The sign that may stand between columns in a line that was read as one cell."""
    return next((name for name, sign in DELIMITERS.items() if sign and sign in line), "")


def _wrong_width(
    line: int, cells: Sequence[str], width: int, layout: Layout, source: str, end: str
) -> BadInput:
    remedy = f"Expected {width}, as in the {'header' if layout.header else 'first row'}"
    if layout.fields:
        remedy = f"Expected {width}, as the map says"
    if len(cells) == 1 and width > 1 and (other := _other_delimiter(cells[0])):
        remedy += f'; between columns may stand "{other}"'
    if len(cells) == 2 * width - 1 or (layout.delimiter == "," and len(cells) > width):
        remedy += "; decimals behind a comma need another delimiter or quotation marks"
    remedy += end
    return BadInput(f"{len(cells)} fields found", place=f"{source}, line {line}", remedy=remedy)
