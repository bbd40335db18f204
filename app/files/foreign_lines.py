"""The lines of a foreign file that are its table's, and their cells."""

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from app.files.foreign_layout import DELIMITERS, Layout
from app.files.patterns import find
from calib.errors import BadInput
from calib.plain_text import plain

LARGEST_BYTES = 500_000_000
_SEP_LINE = re.compile(r"sep=(.)\s*", re.IGNORECASE)


def decoded(path: Path, encoding: str) -> str:
    """The text of a file; raises BadInput with what it is instead, and on which line."""
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


def lines_of(text: str, layout: Layout, source: str) -> tuple[list[tuple[int, str]], list[str]]:
    """Lines of the table with their numbers, and what is assumed of them.

    Raises
    ------
    BadInput
        If the text is empty or does not begin as the layout says.
    """
    lines = text.split("\n")
    if not text.strip():
        raise BadInput(
            "the file is empty", place=f"{source}, line 1", remedy="Name a table with rows"
        )
    begin = _begin(lines, layout, source)
    notes: list[str] = []
    kept: list[tuple[int, str]] = []
    for number, line in enumerate(lines[begin:], start=begin + 1):
        if layout.end and find(layout.end, line, f"{source}, line {number}"):
            break
        if number == 1 and (sep := _SEP_LINE.fullmatch(line)):
            notes.append(_separator(sep.group(1), layout, source))
            continue
        if line.strip() and not line.lstrip().startswith(layout.comments or ("\x00",)):
            kept.append((number, line))
    return kept, notes


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
        if find(layout.after, lines[at], f"{source}, line {at + 1}"):
            return at + 1
    raise BadInput(
        f"there is no line as the table should begin behind ({layout.after})",
        place=source,
        remedy="Correct after under [file] of the map; or this is a file of another program",
    )


def split(
    kept: Sequence[tuple[int, str]], layout: Layout, source: str
) -> list[tuple[int, list[str]]]:
    """Cells of lines that are not empty; raises BadInput for quotation marks left open.

    A quotation mark may stand behind a blank (``"A", "B"``).
    """
    if layout.delimiter == "blanks":
        return [(number, _blanks(line)) for number, line in kept]
    numbers = [number for number, _ in kept]
    reader = csv.reader(
        (line + "\n" for _, line in kept), delimiter=DELIMITERS[layout.delimiter], strict=True,
        skipinitialspace=layout.delimiter != "tab",
    )  # fmt: skip
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
