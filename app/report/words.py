"""Numbers and moments as a record prints them."""

import math
from datetime import datetime

MINUS = "−"


def with_uncertainty(value: float, uncertainty: float) -> tuple[str, str]:
    """A value and its uncertainty, both to the second digit of the uncertainty.

    >>> with_uncertainty(230.612345, 0.00481)
    ('230.6123', '0.0048')
    """
    if not (math.isfinite(uncertainty) and uncertainty > 0.0):
        return f"{value:.6g}", "–"
    digits = max(0, 1 - math.floor(math.log10(uncertainty)))
    if digits > 9:
        return plain(f"{value:.2e}"), f"{uncertainty:.1e}"
    return plain(f"{value:.{digits}f}"), f"{uncertainty:.{digits}f}"


def plain(text: str) -> str:
    """A number as text without the minus of a zero, and with a true minus."""
    if text.startswith("-") and not text.strip("-0."):
        text = text[1:]
    return text.replace("-", MINUS)


def day(utc: str) -> str:
    """``2026-11-29`` of an ISO moment; empty if it is empty."""
    return utc[:10]


def minute(utc: str) -> str:
    """``2026-11-29 06:25 UTC`` of an ISO moment; empty if it is empty."""
    return f"{datetime.fromisoformat(utc):%Y-%m-%d %H:%M} UTC" if utc else ""
