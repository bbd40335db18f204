"""Tables that people write for the mocks, as TOML or JSON."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.errors import BadInput
from calib.plain_text import plain
from calib.quantity import in_short, is_meant
from calib.toml_place import joined_names, load_toml


def read_table(path: Path) -> Mapping[str, Any]:
    """A table from a TOML file, or from JSON where the name ends so.

    Raises ValueError with the file and the line of a fault.
    """
    try:
        text = plain(path.read_bytes().decode("utf-8"))
        table = json.loads(text) if path.suffix == ".json" else load_toml(text, str(path))
    except BadInput as error:
        raise ValueError(str(error)) from error
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {error}") from error
    if not isinstance(table, dict):
        raise ValueError(f"{path}: a table of names and numbers is expected, not {table!r}")
    return table


def numbers_by_name(table: Mapping[str, object], what: str) -> dict[str, float]:
    """Numbers by their dotted names; raises ValueError for a value that is none that can be meant.

    ``leg1.L0 = 1.0`` without quotes is such a name too. ``what`` the numbers are, for messages.
    """
    found = joined_names(table)
    for name, value in found.items():
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (number and is_meant(value)):
            raise ValueError(
                f'{what} "{name[:80]}" must be a number that can be meant, got {in_short(value)}'
            )
    return {name: float(value) for name, value in found.items()}
