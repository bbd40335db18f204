"""Where in a TOML text a key stands, so that an error can name its line."""

import re
import tomllib
from typing import Any

from calib.errors import BadInput

_HEADER = re.compile(r"^\s*\[{1,2}\s*(.+?)\s*\]{1,2}\s*(#.*)?$")
_KEY = re.compile(
    r"^\s*((?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*'))*)\s*="
)
_PART = re.compile(r"[A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*'")


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))


def line_of(text: str, *keys: str) -> int:
    """Line (from 1) on which ``keys`` is set, or the nearest enclosing table; 1 if none is.

    Parameters
    ----------
    text : str
        TOML source.
    *keys : str
        Path of the key, for example ``"limbs", "leg1", "B_x"``.
    """
    best, best_length = 1, 0
    table: tuple[str, ...] = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            table = _parts(header.group(1))
            path = table
        elif key := _KEY.match(line):
            path = table + _parts(key.group(1))
        else:
            continue
        if len(path) > best_length and path == keys[: len(path)]:
            best, best_length = number, len(path)
    return best


def load_toml(text: str, source: str) -> dict[str, Any]:
    """Parse TOML; a syntax error becomes :class:`BadInput` with file and line."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        found = re.search(r"\(at line (\d+), column (\d+)\)", message)
        line = f", line {found.group(1)}" if found else f", line {len(text.splitlines()) or 1}"
        what = re.sub(r"\s*\(at [^)]*\)", "", message)
        raise BadInput(
            f"this is not valid TOML: {what}", place=f"{source}{line}", remedy="Correct the syntax."
        ) from error
