"""Numbers as people read them: to the second digit of their uncertainty, and no further."""

import math
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeGuard

MOST = 15
"""Digits that a double holds; an uncertainty below asks for no more."""
SMALL, LARGE = 1e-4, 1e8
"""Between these a number is written without a power of ten."""


@dataclass(frozen=True)
class Digits:
    """How a value and what belongs to it are written: alike, so that their digits stand alike.

    Attributes
    ----------
    last
        Power of ten of the last digit, that of the second digit of the uncertainty; None where
        there is no uncertainty: six digits are written then.
    power
        Power of ten that all numbers have behind them; 0: none is written.
    """

    last: int | None
    power: int = 0

    @classmethod
    def of(cls, sigma: float | None, *values: float | None) -> "Digits":
        """Digits of values with one standard uncertainty, all in one unit."""
        if not _known(sigma):
            return cls(None)
        largest = max([sigma, *(abs(v) for v in values if v is not None and math.isfinite(v))])
        last = max(_first_digit(sigma, 2) - 1, _first_digit(largest, MOST) - MOST + 1)
        first = _first_digit(largest, 2)
        plain = SMALL <= largest < LARGE
        return cls(last, 0 if plain else first)

    def text(self, value: float | None, *, signed: bool = False) -> str:
        """One of the numbers; with its sign also where it is positive. "-" where there is none."""
        if value is None or not math.isfinite(value):
            return "-"
        sign = "+" if signed else ""
        if self.last is None:
            return _unsigned_zero(format(value, f"{sign}.6g"))
        scaled = Decimal(value).scaleb(-self.power)  # exact: what stands half way goes one way
        shown = format(scaled, f"{sign}.{max(self.power - self.last, 0)}f")
        if self.last > self.power:  # an uncertainty of hundreds: zeros stand in place of digits
            shown = format(round(value, -self.last), f"{sign}.0f")
        return _unsigned_zero(shown) + (f"e{self.power:+03d}" if self.power else "")


def plus_minus(value: float, sigma: float | None, unit: str = "", sign: str = "+-") -> str:
    """A value with its standard uncertainty: ``0.000134 +- 0.000028 mm/N``, ``5.40 +- 0.48 s``.

    A ratio, of unit 1, has none written.
    """
    unit = "" if unit == "1" else unit
    digits = Digits.of(sigma, value)
    if sigma is None:
        return f"{digits.text(value)} {unit}".rstrip()
    return f"{digits.text(value)} {sign} {digits.text(sigma)} {unit}".rstrip()


def length(mm: float) -> str:
    """A length to three digits: ``4.57 mm``, ``114 um``."""
    if abs(mm) >= 0.9995:  # 999.5 um is a millimetre to three digits
        return f"{mm:.3g} mm" if abs(mm) < 999.5 else f"{mm:.0f} mm"
    return f"{1000.0 * mm:.3g} um"


def turn(rad: float) -> str:
    """An angle to three digits: ``400 mrad``, ``9.28 urad``."""
    return f"{1e3 * rad:.3g} mrad" if abs(rad) >= 0.9995e-3 else f"{1e6 * rad:.3g} urad"


def rounded(value: float | None, sigma: float | None) -> str:
    """A value alone, to the second digit of its uncertainty."""
    return Digits.of(sigma, value).text(value)


def fixed(value: float, decimals: int, *, signed: bool = False) -> str:
    """A number with so many decimals; what rounds to zero has no sign."""
    return _unsigned_zero(format(value, f"{'+' if signed else ''}.{decimals}f"))


def _known(sigma: float | None) -> TypeGuard[float]:
    return sigma is not None and math.isfinite(sigma) and sigma > 1e-290


def _first_digit(number: float, digits: int) -> int:
    """Power of ten of the first digit once a number is rounded to so many digits."""
    return int(f"{number:.{digits - 1}e}".partition("e")[2])


def _unsigned_zero(text: str) -> str:
    return text if any(digit in text for digit in "123456789") else text.lstrip("-+")
