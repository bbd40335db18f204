"""Tables as instruments and programs write them: cells with the line on which each row stands.

How the text is laid out is stated, never guessed: encoding, delimiter, decimal sign, lines that are
none of the table's. What does not fit is named with line and column.
"""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from calib.errors import BadInput
from calib.plain_text import plain
from calib.quantity import is_meant
from calib.toml_table import TomlTable
from calib.units import split_header

Column = str | int
"""A column by its name, or by its number from 1 on."""

DELIMITERS = {",": ",", ";": ";", "tab": "\t", "|": "|", "blanks": ""}
ENCODINGS = ("utf-8", "latin-1", "cp1252", "utf-16")
THOUSANDS = ("", ",", ".", "'", " ")
LARGEST_BYTES = 500_000_000
_SEP_LINE = re.compile(r"sep=(.)\s*", re.IGNORECASE)


@dataclass(frozen=True)
class Layout:
    """How a text holds a table.

    Attributes
    ----------
    delimiter : str
        One of :data:`DELIMITERS`.
    decimal, thousands : str
        Sign before the decimals, and the sign between thousands (none: "").
    comments : tuple of str
        Beginnings of lines that are none of the table's.
    skip : int
        Lines before the table, of any kind.
    after, end : str
        Patterns: the table begins behind the first line in which ``after`` is found, and ends
        before one in which ``end`` is.
    header, units_row : bool
        Whether a line of names comes first, and one of units behind it.
    missing : tuple of str
        Cells that say that there is nothing.
    fields : int
        Cells that every row has; 0: as many as the first.
    """

    encoding: str = "utf-8"
    delimiter: str = ","
    decimal: str = "."
    thousands: str = ""
    comments: tuple[str, ...] = ()
    skip: int = 0
    after: str = ""
    end: str = ""
    header: bool = True
    units_row: bool = False
    missing: tuple[str, ...] = ()
    fields: int = 0


def layout_of(table: TomlTable) -> Layout:
    """Read the table ``[file]`` of a map; raises BadInput with line and key."""
    decimal = table.choice("decimal", (".", ","), ".")
    thousands = table.choice("thousands", THOUSANDS, "")
    delimiter = table.choice("delimiter", tuple(DELIMITERS), ",")
    if thousands == decimal:
        raise table.wrong("thousands and decimals have one sign", "thousands")
    if delimiter == decimal:
        raise table.wrong(
            "a comma cannot stand between columns and before decimals", "decimal",
            remedy='Such files have delimiter = ";" or "tab"',
        )  # fmt: skip
    if thousands == " " and delimiter == "blanks":
        raise table.wrong("blanks cannot stand between columns and thousands", "thousands")
    layout = Layout(
        encoding=table.choice("encoding", ENCODINGS, "utf-8"),
        delimiter=delimiter,
        decimal=decimal,
        thousands=thousands,
        comments=tuple(table.texts("comments")),
        skip=table.whole("skip", 0),
        after=pattern_of(table, "after"),
        end=pattern_of(table, "end"),
        header=table.flag("header", True),
        units_row=table.flag("units_row", False),
        missing=tuple(table.texts("missing")),
        fields=table.whole("fields", 0),
    )
    table.end()
    return layout


def pattern_of(table: TomlTable, key: str) -> str:
    """Read a regular expression; "" where it is missing; raises BadInput if it is none."""
    text = table.text(key, "")
    try:
        re.compile(text)
    except re.error as error:
        raise table.wrong(f"{key} is no pattern: {error}", key) from error
    return text


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
            raise BadInput(
                f"found {cell!r}", place=self.place(row, at), remedy=_remedy(cell, self.layout)
            )
        return value


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


def _remedy(cell: str, layout: Layout) -> str:
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


def read_foreign(path: Path, layout: Layout) -> ForeignTable:
    """Read a file as it is laid out.

    Raises
    ------
    BadInput
        With file, line and column, for what does not fit the layout.
    """
    return table_of(_decoded(path, layout.encoding), layout, str(path))


def _decoded(path: Path, encoding: str) -> str:
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise BadInput("the file is larger than 500 MB", place=str(path), remedy="Split it")
        raw = path.read_bytes()
    except OSError as error:
        reason = "the file is missing" if isinstance(error, FileNotFoundError) else error.strerror
        raise BadInput(
            reason or str(error), place=str(path), remedy="Name a file that can be read"
        ) from error
    if encoding == "utf-8" and raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise BadInput(
            "the file is UTF-16", place=f"{path}, line 1",
            remedy='Write encoding = "utf-16" under [file] of the map',
        )  # fmt: skip
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError as error:
        raise BadInput(
            f"byte 0x{raw[error.start]:02x} is not {encoding.upper()}",
            place=f"{path}, line {raw[: error.start].count(10) + 1}",
            remedy='Write encoding = "latin-1" (or cp1252, utf-16) under [file] of the map',
        ) from error
    if "\x00" in text:
        line = text[: text.index("\x00")].count("\n") + 1
        raise BadInput(
            "the file holds a zero byte: this is no text", place=f"{path}, line {line}",
            remedy="Export the table as text; sheets and other binary files are not read",
        )  # fmt: skip
    return plain(text)


def table_of(text: str, layout: Layout, source: str) -> ForeignTable:
    """The table in a text, see :func:`read_foreign`."""
    lines = text.split("\n")
    if not text.strip():
        raise BadInput(
            "the file is empty", place=f"{source}, line 1", remedy="Name a table with rows"
        )
    begin = _begin(lines, layout, source)
    notes: list[str] = []
    kept: list[tuple[int, str]] = []
    for number, line in enumerate(lines[begin:], start=begin + 1):
        if layout.end and re.search(layout.end, line):
            break
        if number == 1 and (sep := _SEP_LINE.fullmatch(line)):
            notes.append(_separator(sep.group(1), layout, source))
            continue
        if line.strip() and not line.lstrip().startswith(layout.comments or ("\x00",)):
            kept.append((number, line))
    rows = _split(kept, layout, source)
    return _with_header(rows, layout, source, notes)


def _separator(said: str, layout: Layout, source: str) -> str:
    """What Excel's first line ``sep=;`` says; raises BadInput where the map says another thing."""
    if said != DELIMITERS[layout.delimiter]:
        name = next((name for name, sign in DELIMITERS.items() if sign == said), said)
        raise BadInput(
            f'the file says that "{said}" stands between columns, the map "{layout.delimiter}"',
            place=f"{source}, line 1",
            remedy=f'Write delimiter = "{name}" under [file] of the map',
        )
    return f'line 1 ("sep={said}") is Excel\'s'


def _begin(lines: Sequence[str], layout: Layout, source: str) -> int:
    """How many lines come before the table."""
    if layout.skip > len(lines):
        raise BadInput(
            f"the file has {len(lines)} lines, and {layout.skip} are to be skipped",
            place=source,
            remedy="Correct skip under [file] of the map",
        )
    if not layout.after:
        return layout.skip
    for at in range(layout.skip, len(lines)):
        if re.search(layout.after, lines[at]):
            return at + 1
    raise BadInput(
        f"there is no line as the table should begin behind ({layout.after})",
        place=source,
        remedy="Correct after under [file] of the map; or this is a file of another program",
    )


def _split(
    kept: Sequence[tuple[int, str]], layout: Layout, source: str
) -> list[tuple[int, list[str]]]:
    if layout.delimiter == "blanks":
        return [(number, _blanks(line)) for number, line in kept]
    numbers = [number for number, _ in kept]
    reader = csv.reader(
        (line + "\n" for _, line in kept), delimiter=DELIMITERS[layout.delimiter], strict=True
    )
    rows: list[tuple[int, list[str]]] = []
    try:
        rows.extend((numbers[reader.line_num - 1], cells) for cells in reader)
    except csv.Error as error:
        raise BadInput(
            f"not readable as separated values: {error}",
            place=f"{source}, line {numbers[min(reader.line_num, len(numbers)) - 1]}",
            remedy="Look for a quotation mark that is not closed",
        ) from error
    return [(number, cells) for number, cells in rows if any(cell.strip() for cell in cells)]


def _blanks(line: str) -> list[str]:
    """Cells between blanks; what stands in double quotes is one."""
    return [a or b for a, b in re.findall(r'"([^"]*)"|(\S+)', line)]


def _with_header(
    rows: list[tuple[int, list[str]]], layout: Layout, source: str, notes: list[str]
) -> ForeignTable:
    header_line, names, units = 0, [], []
    if layout.header:
        if not rows:
            raise BadInput("there is no line of names", place=source, remedy="See skip and after")
        (header_line, cells), *rows = rows
        names, units = map(list, zip(*(split_header(cell) for cell in cells), strict=True))
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
    for line, cells in rows:
        if len(cells) != width:
            raise _wrong_width(line, cells, width, layout, source)
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
    line: int, cells: Sequence[str], width: int, layout: Layout, source: str
) -> BadInput:
    remedy = f"Expected {width}, as in the {'header' if layout.header else 'first row'}"
    if layout.fields:
        remedy = f"Expected {width}, as the map says"
    if len(cells) == 1 and width > 1 and (other := _other_delimiter(cells[0])):
        remedy += f'; between columns may stand "{other}"'
    if len(cells) == 2 * width - 1 or (layout.delimiter == "," and len(cells) > width):
        remedy += "; decimals behind a comma need another delimiter or quotation marks"
    return BadInput(f"{len(cells)} fields found", place=f"{source}, line {line}", remedy=remedy)
