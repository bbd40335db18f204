"""The way that the actuators were told to go: what an effect with a memory looks back on.

Every row of a run is on the path, moves without a reading too. A row knows the row before it, so
that poses of a run that is not measured yet can each go on from the same past.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, IntArray

Move = Callable[[Array, int], Array]
"""(state (k,) at the row before, row) -> state (k,) at that row."""


@dataclass(frozen=True, eq=False)
class CommandedPath:
    """M rows of one or several runs; no row of one run comes after a row of another.

    Attributes
    ----------
    extension : (n, M)
        Commanded extension of the actuators, mm or rad.
    time_s : (M,)
        Seconds from the start of the run.
    before : (M,)
        The row before each, an earlier column; -1 at the start of a run.
    motion : (n,)
        Changes of extension up to this are rounding, not motion.
    """

    extension: Array
    time_s: Array
    before: IntArray
    motion: Array

    @classmethod
    def of_run(cls, extension: Array, time_s: Array, motion: Array) -> "CommandedPath":
        """The rows of one run, one after the other: (n, M), (M,), (n,)."""
        return cls(extension, time_s, np.arange(-1, time_s.size - 1, dtype=np.intp), motion)

    @property
    def count(self) -> int:
        """Number of rows M."""
        return self.time_s.size

    def branched(self, after: int, extension: Array, time_s: float) -> "CommandedPath":
        """The same with C other rows that could come next after the row ``after``: (n, C)."""
        count = extension.shape[1]
        return replace(
            self,
            extension=np.concatenate([self.extension, extension], axis=1),
            time_s=np.concatenate([self.time_s, np.full(count, time_s)]),
            before=np.concatenate([self.before, np.full(count, after, dtype=np.intp)]),
        )

    def carry(self, begin: Array, move: Move) -> Array:
        """Carry a state along the path, from the start of every run.

        Parameters
        ----------
        begin : (k, M)
            State at a row that begins a run; only these columns are used.
        move : callable
            State at the row before, and the row; answers with the state there.

        Returns
        -------
        (k, M)
        """
        states = np.array(begin, dtype=np.float64)
        for row in np.flatnonzero(self.before >= 0):
            states[:, row] = move(states[:, self.before[row]], int(row))
        return states

    @cached_property
    def change(self) -> Array:
        """Change of extension (n, M) since the row before; 0 at the start and for rounding."""
        begins = self.before < 0
        change = self.extension - self.extension[:, np.where(begins, 0, self.before)]
        moved = np.abs(change) > self.motion[:, None]
        return np.where(moved & ~begins, change, 0.0)

    @cached_property
    def step(self) -> Array:
        """Last change of each actuator (n, M) up to a row, with its sign; 0 before the first."""
        change, rows = self.change, np.arange(self.count)
        begins = self.before < 0
        if (begins | (self.before == rows - 1)).all():
            there = np.where((change != 0.0) | begins, rows, 0)
            latest = np.maximum.accumulate(there, axis=1)
            return change[np.arange(len(change))[:, None], latest]
        return self.carry(
            np.zeros_like(change),
            lambda last, row: np.where(change[:, row] != 0.0, change[:, row], last),
        )

    @property
    def direction(self) -> Array:
        """Direction of approach (n, M): sign of the last change; 0 before the first."""
        return np.sign(self.step)

    @cached_property
    def moment(self) -> Array:
        """Time (M,) in s of each row; rows of one time are spread over half the gap to the next."""
        moment = self.time_s.copy()
        new = (self.before < 0) | (np.diff(self.time_s, prepend=-np.inf) != 0.0)
        start = np.flatnonzero(new)
        many = np.diff(np.append(start, self.count))
        last = np.append(self.before[start[1:]] < 0, True)
        gap = np.where(last, 1.0, np.diff(self.time_s[start], append=0.0))
        for first, count, wide in zip(start, many, gap, strict=True):
            moment[first : first + count] += 0.5 * wide * np.arange(count) / count
        return moment

    @cached_property
    def stop(self) -> IntArray:
        """Number (M,) of the stop at which each row is: rows between which nothing moved share it.

        Two readings at one stop have one past, but for the time that they stood there.
        """
        still = np.all(self.extension == self.extension[:, np.maximum(self.before, 0)], axis=0)
        still &= self.before >= 0
        stop = np.arange(self.count, dtype=np.intp)
        for row in np.flatnonzero(still):
            stop[row] = stop[self.before[row]]
        return stop


def joined_paths(paths: Sequence[CommandedPath]) -> CommandedPath:
    """Paths of several runs, one after the other; each keeps its own past."""
    starts = np.cumsum([0, *(path.count for path in paths[:-1])])
    return CommandedPath(
        np.concatenate([path.extension for path in paths], axis=1),
        np.concatenate([path.time_s for path in paths]),
        np.concatenate(
            [
                np.where(path.before < 0, -1, path.before + start)
                for path, start in zip(paths, starts, strict=True)
            ]
        ),
        paths[0].motion,
    )
