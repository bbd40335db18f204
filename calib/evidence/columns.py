"""Columns of a candidate (T, k, R): held while they are few, else made anew a few trials at a time.

A scan over periods has hundreds of trials, each as long as the readings. What is asked of them are
products with few vectors; so columns that would fill the memory are made when a product is asked
for and forgotten again, in blocks of a size that does not depend on how many readings there are
but for some thirty columns, which are the least. Products are the same in blocks and at once.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array

HELD = 3_000_000
"""Numbers that all columns of one question may hold together (24 MB)."""
BLOCK, ABREAST = 1_000_000, 32
"""Numbers in a block of trials, unless so many columns have more: what is done reading by reading
for all columns of a block together costs the same for one."""

Make = Callable[[int, int], Array]
"""First trial, last trial + 1 -> their columns (t, k, R)."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of T trials, k unknowns and R components of readings.

    Attributes
    ----------
    shape : (T, k, R)
    make : callable
        Makes those of successive trials.
    there : bool
        Whether they are held already.
    recipe : Columns, optional
        Of those that are held: how they were made.
    """

    shape: tuple[int, int, int]
    make: Make
    there: bool = False
    recipe: "Columns | None" = None

    @classmethod
    def of(cls, array: Array) -> "Columns":
        """Columns (T, k, R) that are there."""
        trials, unknowns, rows = array.shape
        return cls((trials, unknowns, rows), lambda first, last: array[first:last], there=True)

    @property
    def size(self) -> int:
        """How many numbers they are."""
        return int(np.prod(self.shape, dtype=np.int64))

    def __getitem__(self, trial: int) -> Array:
        """Columns (k, R) of one trial."""
        trial = range(self.shape[0])[trial]
        return np.asarray(self._made(trial, trial + 1)[0])

    def blocks(self) -> Iterator[tuple[slice, Array]]:
        """Trials and their columns (t, k, R), all of them, a few trials at a time."""
        wide, rows = max(self.shape[1], 1), max(self.shape[2], 1)
        each = max(1, ABREAST // wide, BLOCK // (wide * rows))
        for first in range(0, self.shape[0], each):
            last = min(first + each, self.shape[0])
            yield slice(first, last), self._made(first, last)

    def changed(self, how: Callable[[Array], Array]) -> "Columns":
        """The same with every block (t, k, R) changed by ``how``, when it is made."""
        return Columns(self.shape, lambda first, last: how(self.make(first, last)))

    def released(self) -> "Columns":
        """The same, held no longer; made anew when asked for."""
        return self.recipe or self

    def _made(self, first: int, last: int) -> Array:
        made = self.make(first, last)
        if not np.isfinite(made).all():
            raise ValueError("columns are not finite; see fill_missing")
        return made


class Room:
    """Holds the columns of one question while there is room; the others are made when asked for."""

    def __init__(self, numbers: int | None = None) -> None:
        self._left = HELD if numbers is None else numbers

    def held(self, columns: Columns) -> Columns:
        """The same columns, in memory if there is room."""
        if columns.there or columns.size > self._left:
            return columns
        self._left -= columns.size
        array = np.empty(columns.shape)
        for part, made in columns.blocks():
            array[part] = made
        return replace(Columns.of(array), recipe=columns)
