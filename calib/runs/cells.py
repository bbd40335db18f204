"""What a cell of ``points.csv`` may hold."""

import math
import re

from calib.quantity import is_meant

SMALLEST_SIGMA = 1e-12
"""No standard uncertainty in mm or rad is smaller."""


def number_in(cell: str) -> float | None:
    """Read a number as written by any program; None for text (and for Python's 1_000)."""
    if "_" in cell:
        return None
    try:
        return float(cell)
    except ValueError:
        return None


def meant_in(cell: str) -> float | None:
    """The same; None also for what is not finite or beyond every number that can be meant."""
    value = number_in(cell)
    return value if value is not None and is_meant(value) else None


def channel_in(cell: str) -> float | None:
    """A reading of a sensor; nan, inf and an empty cell say that there was none."""
    value = number_in(cell) if cell else math.nan
    if value is not None and not math.isfinite(value):
        return None if re.search(r"\d", cell) else math.nan
    return value if value is not None and is_meant(value) else None
