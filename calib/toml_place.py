"""Where in a TOML text a key stands, so that an error can name its line."""

import re
import tomllib
from collections import Counter
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from calib.errors import BadInput
from calib.plain_text import plain

_PLAIN = r"[^\[\]\"'#]*+"
_HEADER = re.compile(
    rf"\s*+\[{{1,2}}({_PLAIN}(?:(?:\"[^\"]*+\"|'[^']*+'){_PLAIN})*+)\]{{1,2}}\s*+(?:#.*)?"
)
_KEY = re.compile(
    r"^\s*((?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*'))*)\s*="
)
MOST_LEVELS = 100
"""Parts of a dotted key: the reader of TOML keeps every beginning of one."""
_DEEP = re.compile(
    r"(?<![\w.-])(?:(?:[\w-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"
    rf"{{{MOST_LEVELS}}}"
)
_PART = re.compile(r"[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*'")


def _parts(dotted: str) -> tuple[str | int, ...]:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))


def line_of(text: str, *keys: str | int) -> int:
    """Line (from 1) on which ``keys`` is set, or the nearest enclosing table; 1 if none is.

    Parameters
    ----------
    text : str
        TOML source.
    *keys : str or int
        Path of the key, for example ``"limbs", "leg1", "B_x"``; a number behind the name of an
        array of tables says which of them, from 0.
    """
    lines = _lines(text)
    for length in range(len(keys), 0, -1):
        if keys[:length] in lines:
            return lines[keys[:length]]
    return 1


@lru_cache(maxsize=16)
def _lines(text: str) -> dict[tuple[str | int, ...], int]:
    """The first line of every path that a line of the text sets."""
    lines: dict[tuple[str | int, ...], int] = {}
    table: tuple[str | int, ...] = ()
    arrays: Counter[tuple[str | int, ...]] = Counter()
    for number, line in enumerate(text.split("\n"), start=1):
        if header := _HEADER.fullmatch(line):
            table = _parts(header.group(1))
            if line.lstrip().startswith("[["):
                arrays[table] += 1
                table = (*table, arrays[table] - 1)
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault(table + _parts(key.group(1)), number)
    return lines


def joined_names(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values by dotted name: ``leg1.L0 = 1.0`` without quotes makes a nested table in TOML."""
    joined: dict[str, Any] = {}
    for key, value in table.items():
        name = f"{prefix}{key}"
        joined |= joined_names(value, f"{name}.") if isinstance(value, Mapping) else {name: value}
    return joined


def keys_of(table: Mapping[str, Any], name: str) -> tuple[str, ...]:
    """The keys that lead to a name of :func:`joined_names`."""
    if name in table:
        return (name,)
    for key, value in table.items():
        if isinstance(value, Mapping) and name.startswith(f"{key}."):
            return (key, *keys_of(value, name[len(key) + 1 :]))
    return (name,)


def load_toml(text: str, source: str) -> dict[str, Any]:
    """Parse TOML; what is empty or no TOML becomes :class:`BadInput` with file, line and column.

    A byte order mark at the beginning and any line ends are tolerated.
    """
    text = plain(text)
    if not text.strip():
        raise BadInput(
            "the file is empty", place=f"{source}, line 1", remedy="It begins with its format"
        )
    if deep := _DEEP.search(text):
        raise BadInput(
            f"a key of more than {MOST_LEVELS} parts",
            place=f"{source}, line {text.count(chr(10), 0, deep.start()) + 1}",
            remedy="Correct this line",
        )
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # brackets in thousands, numbers of a page
        message = str(error)
        found = re.search(r"\(at line (\d+), column (\d+)\)", message)
        if found:
            place = f"{source}, line {found.group(1)}, column {found.group(2)}"
            what = message[: found.start()].strip()
        else:
            long = re.search(r"\d{4301}", text)
            last = text[: long.start()] if long else text
            place = f"{source}, line {len(last.splitlines())}"
            what = message.replace("(at end of document)", "at the end of the file")
        raise BadInput(
            f"not valid TOML: {what}", place=place, remedy="Correct this line"
        ) from error
