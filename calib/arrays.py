"""The array types of the mathematics."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.intp]
CIntArray = npt.NDArray[np.intc]
"""Integers as C has them: tables, and pairs of indices."""
Numbers = npt.NDArray[Any]
"""Real, or complex where a derivative is checked by complex step."""

Selection = slice | BoolArray | IntArray
"""What picks some of the poses."""


def parts_of(which: BoolArray, each: int = 2000) -> Iterator[IntArray]:
    """Indices of what is chosen, a part at a time: what is made of them is never there at once."""
    chosen = np.flatnonzero(which)
    for first in range(0, chosen.size, each):
        yield chosen[first : first + each]
