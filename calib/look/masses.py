"""``payload_kg`` in another unit than kg: lb, newtons, ounces, grams, in all rows or in some.

Masses that are carried are round ones in the unit in which they are known. Numbers that are not
round in kg, and are all round in kg once they are read in another unit, were written in that: if
so few digits as they have would seldom make them so by chance.
"""

import numpy as np

from calib.arrays import Array, BoolArray
from calib.look.digits import decimals_of

UNITS = {
    "lb": 0.45359237, "newtons": 1.0 / 9.80665, "newtons (9.81 m/s2)": 1.0 / 9.81,
    "ounces": 0.028349523125,
}  # fmt: skip
"""kg."""
ROUND_KG = (1.0, 0.5)
"""Masses that are round are multiples of one of these."""
AS_IT_STANDS = 0.02
"""How far (kg) from a round one a mass must be to be none as it stands."""
LEAST_KG = 6e-4
"""How near (kg) to a round one a mass must be that was written with all digits."""
BY_CHANCE = 0.01
"""Probability that masses read in some other unit are round, from which on they were not meant."""


def in_other_unit(masses: Array) -> tuple[str, float, BoolArray] | None:
    """Unit, its kg, and the rows (N,) whose masses are written in it; None for none."""
    finite = np.where(np.isfinite(masses), masses, 0.0)
    odd = (finite > 0.0) & (_off_round(finite) > AS_IT_STANDS)
    there = np.unique(finite[odd])
    if there.size == 0:
        return None
    half = 0.5 * 10.0 ** -decimals_of(there)
    near = {name: max(LEAST_KG, half * unit) for name, unit in UNITS.items()}
    for whole in ROUND_KG:
        chance = sum((2.0 * one / whole) ** there.size for one in near.values())
        for name, unit in UNITS.items():
            if chance < BY_CHANCE and np.all(_off_round(unit * there, whole) < near[name]):
                return name, unit, odd
    return None


def _off_round(masses: Array, whole: float = ROUND_KG[-1]) -> Array:
    return np.asarray(np.abs(masses - whole * np.round(masses / whole)))
