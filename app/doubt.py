"""What people mistype: a number that the machine contradicts, and what was probably meant."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

ENOUGH = 3
"""Numbers from which on the instrument's own zero is known well enough to be counted in."""


@dataclass(frozen=True)
class Doubt:
    """Why a number is doubted, and what may have been meant: a value in mm and how it differs."""

    says: str
    meant: float | None = None
    how: str = ""


def doubt(
    text: str,
    value: float,
    expected: float,
    before: Sequence[tuple[float, float]],
    near: float,
    own_zero: bool,
    read: Callable[[str], float | None],
) -> Doubt | None:
    """What speaks against a number that was typed; None if nothing does.

    Parameters
    ----------
    text : str
        As it was typed; ``read`` makes millimetres of such a text, None of what is no number.
    value, expected : float
        What it says and what the nominal machine expects, mm.
    before : sequence of (value, expected)
        The numbers before, mm: what they are off by in common is the instrument's zero.
    near : float
        How far a machine and its drawing may be apart, mm.
    own_zero : bool
        Whether the instrument shows what it likes at first: only changes say something.
    """
    off = [one - other for one, other in before]
    if own_zero and not off:
        return None
    zero = float(np.median(off)) if own_zero or len(off) >= ENOUGH else 0.0
    apart = value - zero - expected
    if abs(apart) > near:
        found = next(
            (
                (meant, how)
                for meant, how in _meant(text, value, read)
                if abs(meant - value + apart) <= near
            ),
            (None, ""),
        )
        return Doubt(f"it is {apart:+.4g} mm from where the machine should be", *found)
    if before and value == before[-1][0] and abs(expected - before[-1][1]) > 0.5 * near:
        moved = abs(expected - before[-1][1])
        return Doubt(f"it is the number before once more, and the machine has moved {moved:.3g} mm")
    return None


def _meant(
    text: str, value: float, read: Callable[[str], float | None]
) -> Iterator[tuple[float, str]]:
    """Numbers that are easily mistyped as this one, mm, with what would have happened."""
    yield -value, "the sign"
    digits = text.strip()
    for k in range(len(digits) - 1):
        if digits[k : k + 2].isdigit() and digits[k] != digits[k + 1]:
            swapped = digits[:k] + digits[k + 1] + digits[k] + digits[k + 2 :]
            if (meant := read(swapped)) is not None:
                yield meant, "two digits exchanged"
    for factor, how in (
        (10.0, "the decimal point one place"), (0.1, "the decimal point one place"),
        (25.4, "inches"), (1.0 / 25.4, "inches"),
        (1000.0, "a unit a thousand times larger"), (0.001, "a unit a thousand times smaller"),
    ):  # fmt: skip
        yield factor * value, how
