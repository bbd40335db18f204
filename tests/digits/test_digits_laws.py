"""Numbers are written to the second digit of their uncertainty: laws for any value."""

import math

from hypothesis import assume, given
from hypothesis import strategies as st

from calib.digits import Digits, fixed, plus_minus, rounded

values = st.floats(-1e12, 1e12, allow_nan=False)
sigmas = st.floats(1e-12, 1e12)


@given(values, sigmas)
def test_what_is_written_is_the_value_to_half_a_unit_of_the_last_digit(
    value: float, sigma: float
) -> None:
    text = rounded(value, sigma)
    unit = 10.0 ** Digits.of(sigma, value).last
    assert abs(float(text) - value) <= 0.5 * unit * (1.0 + 1e-9) + 1e-15 * abs(value)


@given(values, sigmas)
def test_an_uncertainty_has_two_digits(value: float, sigma: float) -> None:
    assume(abs(value) < 1e12 * sigma)
    written = float(Digits.of(sigma, value).text(sigma))
    assert math.isclose(written, float(f"{sigma:.1e}"), rel_tol=1e-9)


@given(values, sigmas)
def test_value_and_uncertainty_end_at_the_same_digit(value: float, sigma: float) -> None:
    left, _, right = plus_minus(value, sigma).partition(" +- ")
    assert _tail(left) == _tail(right)


@given(values, sigmas)
def test_the_sign_is_that_of_what_is_written(value: float, sigma: float) -> None:
    digits = Digits.of(sigma, value)
    text, opposite = digits.text(value), digits.text(-value)
    assert text.lstrip("-") == opposite.lstrip("-")
    zero = float(text) == 0.0
    assert text.startswith("-") == (value < 0.0 and not zero)
    assert digits.text(value, signed=True).startswith("+") == (value > 0.0 and not zero)


@given(values, sigmas)
def test_written_and_read_back_it_is_written_alike(value: float, sigma: float) -> None:
    assume(abs(value) < 1e9 * sigma)
    left, _, right = plus_minus(value, sigma).partition(" +- ")
    again = plus_minus(float(left), float(right))
    assert tuple(map(float, again.split(" +- "))) == (float(left), float(right))


@given(st.floats(allow_nan=True, allow_infinity=True), st.floats(allow_nan=True) | st.none())
def test_any_two_numbers_are_written(value: float, sigma: float | None) -> None:
    text = plus_minus(value, sigma, "mm")
    assert text
    assert not text.startswith("-0 ")


def test_as_people_write_it() -> None:
    assert plus_minus(0.0002, 1.8e-5, "mm/N") == "0.000200 +- 0.000018 mm/N"
    assert plus_minus(1.2e-5, 1.6e-6) == "1.20e-05 +- 0.16e-05"
    assert plus_minus(-3e-8, 1.6e-6) == "0.0e-06 +- 1.6e-06"
    assert plus_minus(3.9966, 0.00996, "mm") == "3.997 +- 0.010 mm"
    assert plus_minus(12345.0, 123.0) == "12340 +- 120"
    assert plus_minus(0.25, None, "mm") == "0.25 mm"
    assert plus_minus(2.0, 0.0) == "2 +- 0"
    assert Digits.of(0.0012, 0.05).text(None) == "-"


@given(st.floats(-1e6, 1e6), st.integers(0, 6))
def test_what_rounds_to_zero_has_no_sign(value: float, decimals: int) -> None:
    text = fixed(value, decimals, signed=True)
    assert abs(float(text) - value) <= 0.5 * 10.0**-decimals * (1.0 + 1e-9) + 1e-9
    assert text[0] in "+-" or float(text) == 0.0
    assert float(text) != 0.0 or text[0] == "0"


def _tail(text: str) -> tuple[int, str]:
    """Digits after the point, and the power of ten."""
    number, _, power = text.partition("e")
    return len(number.partition(".")[2]), power
