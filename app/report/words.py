"""Numbers and moments as a record prints them."""

from datetime import datetime

from calib.digits import Digits

MINUS = "−"


def with_uncertainty(value: float, uncertainty: float) -> tuple[str, str]:
    """A value and its uncertainty, both to the second digit of the uncertainty.

    >>> with_uncertainty(230.612345, 0.00481)
    ('230.6123', '0.0048')
    """
    digits = Digits.of(uncertainty, value)
    value_text, spread = plain(digits.text(value)), digits.text(uncertainty)
    return value_text, spread if uncertainty > 0.0 else "–"


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
