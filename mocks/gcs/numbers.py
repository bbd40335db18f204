"""Numbers as they come over the wire."""

import math

from mocks.gcs.errors import Code, GcsError


def real(text: str) -> float:
    """Read a finite number; raises GcsError."""
    try:
        value = float(text)
    except ValueError as error:
        raise GcsError(Code.NOT_A_NUMBER) from error
    if not math.isfinite(value):
        raise GcsError(Code.OUT_OF_RANGE)
    return value


def whole(text: str) -> int:
    """Read an integer, decimal or 0x; raises GcsError."""
    try:
        return int(text, 0)
    except ValueError as error:
        raise GcsError(Code.NOT_A_NUMBER) from error


def flag(text: str) -> bool:
    """Read 0 or 1; raises GcsError."""
    if text not in ("0", "1"):
        raise GcsError(Code.OUT_OF_RANGE)
    return text == "1"
