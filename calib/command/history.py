"""What a machine was commanded before: backlash, settling and creep look back on it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array, IntArray
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.runs.commanded import CommandedPath

LONGEST = 4096
"""Commands that are kept, whatever remembers them."""


@dataclass(frozen=True, eq=False)
class History:
    """H commands that a machine was given, the oldest first.

    Attributes
    ----------
    extension : (n, H)
        Commanded extensions s = q - reference, mm or rad.
    time_s : (H,)
        When it was told so, s.
    step : (n, H) or None
        Last change of every actuator up to each, as :class:`CommandedPath` has it; None where it
        has not been looked at yet.
    """

    extension: Array
    time_s: Array
    step: Array | None = None

    @classmethod
    def at(cls, extension: Array, time_s: float = 0.0) -> "History":
        """A machine that stands at an extension (n,), nothing known of how it came there."""
        place = np.array(extension, dtype=np.float64)[:, None]
        return cls(place, np.array([time_s]), np.zeros_like(place))

    @classmethod
    def at_home(cls, machine: Machine) -> "History":
        """A machine that was referenced and went home: as a run begins."""
        return cls.at(machine.extension(machine.home_q[:, None])[:, 0])

    @property
    def count(self) -> int:
        """Number of commands H."""
        return self.time_s.size

    def then(self, extension: Array, time_s: float) -> "History":
        """The same with one more command (n,)."""
        return History(
            np.concatenate([self.extension, np.asarray(extension)[:, None]], axis=1),
            np.append(self.time_s, time_s),
        )

    def condensed(self, motion: Array, *, whole_path: bool) -> "History":
        """As short a history as leaves every effect what it was.

        Parameters
        ----------
        motion : (n,)
            Changes up to this are rounding.
        whole_path : bool
            Whether an effect looks back on more than the last step of every actuator; the last
            ``LONGEST`` commands are kept then.
        """
        if whole_path:
            return History(self.extension[:, -LONGEST:], self.time_s[-LONGEST:])
        if self.count <= 2:
            return self
        latest, step = self.extension[:, -1], np.zeros(motion.size)
        after, moved = latest, np.zeros(motion.size, dtype=bool)
        for row in range(self.count - 2, -1, -1):
            before = self.extension[:, row]
            change = after - before
            now = ~moved & (np.abs(change) > motion)
            step[now] = change[now]
            moved |= now
            if moved.all():
                break
            after = before
        kept, steps = np.empty((motion.size, 2)), np.zeros((motion.size, 2))
        kept[:, 0], kept[:, 1], steps[:, 1] = latest - step, latest, step
        return History(kept, self.time_s[-2:], steps)

    def ahead(self, time_s: Array, motion: Array, steps: IntArray) -> "Ahead":
        """N commands that come next, wherever they will be.

        Parameters
        ----------
        time_s, motion : (N,), (n,)
            When; and changes up to which they are rounding.
        steps : (N,)
            For each command the command (0..N-1) that it follows, -1 for the last of the history.

        Raises
        ------
        BadInput
            If a command is told to come before what it follows.
        """
        held, count = self.count, time_s.size
        before = np.maximum(steps, -1) + held  # -1: the last that is held
        times = np.concatenate([self.time_s, time_s])
        early = time_s < times[before]
        if early.any():
            late = int(np.argmax(early))
            raise BadInput(
                f"command {late + 1} is for {time_s[late]:.6g} s, and what comes before it for "
                f"{times[before[late]]:.6g} s",
                remedy="Give times that do not go back",
            )
        chain = np.concatenate([np.arange(-1, held - 1, dtype=np.intp), before])
        own = np.arange(held, held + count, dtype=np.intp)
        return Ahead(self.extension, times, chain, own, motion, self.step)


@dataclass(frozen=True, eq=False)
class Ahead:
    """N commands after H of a history: extensions ``past`` (n, H), and times and order of all.

    ``time_s`` and ``before`` are (H + N,), ``at`` (N,) their own places, ``motion`` (n,), ``step``
    that of the history.
    """

    past: Array
    time_s: Array
    before: IntArray
    at: IntArray
    motion: Array
    step: Array | None

    def path(self, extension: Array) -> CommandedPath:
        """The way to them, if they are (n, N)."""
        whole = np.concatenate([self.past, extension], axis=1)
        if self.step is not None and self.at.size == 1:
            return _OneMore(whole, self.time_s, self.before, self.motion, self.step)
        return CommandedPath(whole, self.time_s, self.before, self.motion)


@dataclass(frozen=True, eq=False)
class _OneMore(CommandedPath):
    """A way of M rows whose steps are known up to the last row: (n, M - 1)."""

    known: Array

    @cached_property
    def step(self) -> Array:
        """As of any way."""
        before = self.before[-1]
        change = self.extension[:, -1] - self.extension[:, before]
        moved = np.abs(change) > self.motion
        latest = np.where(moved, change, self.known[:, before])
        return np.concatenate([self.known, latest[:, None]], axis=1)
