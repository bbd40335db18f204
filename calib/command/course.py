"""How what the effects change goes on from command to command, for a first guess of the next."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.command.changes import Changes

DEPTH = 5
"""Backward differences that are kept, the value itself among them."""


@dataclass(frozen=True, eq=False)
class Course:
    """Backward differences up to the last command: (k, c, 1) of what :class:`Changes` holds."""

    extension: Array
    parameters: Array | None
    twist: Array | None

    @classmethod
    def after(cls, changes: Changes, before: "Course | None") -> "Course":
        """The course after N commands, ``before`` that up to them."""
        for k in range(max(changes.count - DEPTH, 0), changes.count):
            one = changes.at(k)
            before = cls(
                _table(one.extension, None if before is None else before.extension),
                None
                if one.parameters is None
                else _table(one.parameters, None if before is None else before.parameters),
                None
                if one.twist is None
                else _table(one.twist, None if before is None else before.twist),
            )
        assert before is not None
        return before

    def next(self, rounding: Array) -> Changes:
        """What comes next if it goes on so; ``rounding`` (n, 1) of extensions is none."""
        return Changes(
            _next(self.extension, rounding),
            None if self.parameters is None else _next(self.parameters, 0.0),
            None if self.twist is None else _next(self.twist, 0.0),
        )


def _table(value: Array, before: Array | None) -> Array:
    """Differences after one more value (c, 1)."""
    if before is None:
        return value[None]
    table = np.empty((min(len(before) + 1, DEPTH), *value.shape))
    table[0] = value
    for order in range(1, len(table)):
        np.subtract(table[order - 1], before[order - 1], out=table[order])
    return table


def _next(table: Array, rounding: Array | float) -> Array:
    """One more value: differences are added as long as the next one is smaller still.

    So something that jumped, or goes on in steps of different lengths, is taken as it is.
    """
    if len(table) < 3:
        return np.asarray(table[0])
    size = np.abs(table[1:])
    smooth = (size[1:] < size[:-1]) | (size[1:] <= rounding)
    smooth = np.logical_and.accumulate(smooth, axis=0)
    return np.asarray(table[0] + np.where(smooth, table[1:-1], 0.0).sum(axis=0))
