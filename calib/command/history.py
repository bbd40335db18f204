"""What a machine was commanded before: backlash, settling and creep look back on it."""

from dataclasses import dataclass, replace

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
    """

    extension: Array
    time_s: Array

    @classmethod
    def at(cls, extension: Array, time_s: float = 0.0) -> "History":
        """A machine that stands at an extension (n,), nothing known of how it came there."""
        return cls(np.array(extension, dtype=np.float64)[:, None], np.array([time_s]))

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
        step = CommandedPath.of_run(self.extension, self.time_s, motion).step[:, -1]
        last = self.extension[:, -1]
        return History(np.stack([last - step, last], axis=1), self.time_s[-2:])

    def path(
        self, extension: Array, time_s: Array, motion: Array, steps: IntArray
    ) -> tuple[CommandedPath, IntArray]:
        """The way to N commands (n, N), and the row on it of each.

        Parameters
        ----------
        steps : (N,)
            For each command the command (0..N-1) that it follows, -1 for the last of the history.

        Raises
        ------
        BadInput
            If a command is told to come before what it follows.
        """
        held, count = self.count, time_s.size
        own = held + np.arange(count, dtype=np.intp)
        before = np.where(steps < 0, held - 1, held + steps).astype(np.intp)
        known = CommandedPath.of_run(self.extension, self.time_s, motion)
        times = np.concatenate([self.time_s, time_s])
        if np.any(times[own] < times[before]):
            late = int(np.argmax(times[own] < times[before]))
            raise BadInput(
                f"command {late + 1} is for {time_s[late]:.6g} s, and what comes before it for "
                f"{times[before[late]]:.6g} s",
                remedy="Give times that do not go back",
            )
        path = replace(
            known,
            extension=np.concatenate([self.extension, extension], axis=1),
            time_s=times,
            before=np.concatenate([known.before, before]),
        )
        return path, own
