"""``[limits]`` of a site file: what is normal there."""

import math
from dataclasses import dataclass
from typing import Any

from calib.toml_table import TomlTable

MAY_BE_ZERO = ("warm_up_s", "margin_mm")
"""Limits of which nothing at all is a choice; with another at zero nothing could be measured."""
LEAST_BAND_K = 1.0
"""The air is to come back by half a kelvin into its band before the job goes on."""


@dataclass(frozen=True)
class Limits:
    """What is normal here: mm, s, deg C; every one has a default."""

    hole_radius_mm: float = 4.0
    """How far from its predicted place an SMR may be seen; nests are much farther apart."""
    settle_std_mm: float = 0.020
    """Scatter in the settling window below which the machine stands (tracker noise included)."""
    settle_creep_mm: float = 0.008
    """Largest difference between the means of the window's halves."""
    settle_window_s: float = 0.5
    settle_timeout_s: float = 30.0
    dwell_s: float = 3.0
    drift_mm: float = 0.050
    """Largest shift of the base against the first reference."""
    base_fit_mm: float = 0.050
    """Largest RMS of the base nests against their drawing."""
    two_face_mm: float = 0.100
    air_temp_C: tuple[float, ...] = (10.0, 35.0)
    warm_up_s: float = 60.0
    """How long the channels are watched before the run."""
    warm_up_K_per_min: float = 0.2
    move_timeout_s: float = 120.0
    """Machine seconds that a move may take."""
    margin_mm: float = 0.1
    """Kept free at the ends of strokes when poses are chosen, beyond what tolerances need."""


def read_limits(table: TomlTable) -> Limits:
    """Check ``[limits]``; raises BadInput."""
    known = Limits()
    values: dict[str, Any] = {}
    for name in Limits.__dataclass_fields__:
        default = getattr(known, name)
        if isinstance(default, tuple):
            values[name] = table.numbers(name, len(default), default, unit=_unit_in(name))
        else:
            above = None if name in MAY_BE_ZERO else 0.0
            values[name] = table.number(
                name, default, unit=_unit_in(name), above=above, least=0.0, most=math.inf
            )
    low, high = values["air_temp_C"]
    if high - low <= LEAST_BAND_K:
        table.complain(
            f"air_temp_C is {low:g} to {high:g}: no air would ever be right",
            "air_temp_C",
            remedy=f"Write the lower limit first, the upper more than {LEAST_BAND_K:g} K above it",
        )
    table.end()
    return Limits(**values)


def _unit_in(name: str) -> str:
    """The unit with which a limit's name ends."""
    for ending, unit in {"_mm": "mm", "_K_per_min": "K/min", "_s": "s", "_C": "deg C"}.items():
        if name.endswith(ending):
            return unit
    raise ValueError(f"the limit {name} names no unit")
