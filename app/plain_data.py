"""Plain data: what JSON can say."""

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Signs that move a terminal's cursor, colour it, or turn the order of what is read."""


def printable(text: str) -> str:
    """Text whose controls are written out: what a file or a device says commands no terminal."""
    return _CONTROLS.sub(lambda found: f"\\x{ord(found[0]):02x}", text.replace("\r\n", "\n"))


def plain(value: Any) -> Any:
    """Replace what JSON cannot say, all the way down.

    Numbers that are not finite become None, numpy numbers and arrays plain ones.
    """
    kind = type(value)  # what there is most of goes first: answers have thousands of numbers
    if kind is float:
        return value if math.isfinite(value) else None
    if kind is list:
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, str) or value is None or isinstance(value, bool):
        return value
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Iterable):
        return [plain(item) for item in value]
    return value
