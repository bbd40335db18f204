"""Commands for a machine that is streamed: poses at a rate, block after block.

Each block begins where the one before ended, with what the effects made of its last commands: a
few passes for all its poses together, and steps smaller than a lost motion keep their direction.
Of single poses the effects are asked once where steps are small and even, else twice.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.command.easing import eased
from calib.command.history import History
from calib.command.identified import Identified
from calib.command.solver import Commands, commands_for
from calib.command.surroundings import Surroundings
from calib.errors import BadInput

BLOCK = 50
"""Poses that are solved together: 50 ms at 1 kHz."""


class Trajectory:
    """A machine that is sent along poses; what it was sent is remembered.

    Parameters
    ----------
    identified : Identified
    history : History, optional
        What was commanded before; a machine at home if not given.
    """

    def __init__(self, identified: Identified, history: History | None = None) -> None:
        self._identified = identified
        self._history = history or History.at_home(identified.machine)
        self._last: Commands | None = None

    @property
    def history(self) -> History:
        """What was commanded, as short as the effects allow."""
        return self._history

    def solve(
        self, wanted: Array, surroundings: Surroundings | None = None, *, keep: bool = True
    ) -> Commands:
        """Commands for the next poses; they count as sent unless one is refused.

        Parameters
        ----------
        wanted : (k, N)
            Task coordinates, mm and rad, one after the other.
        surroundings : Surroundings, optional
            As for :func:`commands_for`; times of one trajectory never go back.
        keep : bool
            Whether they count as sent; else it is only asked.

        Raises
        ------
        BadInput
            As :func:`commands_for` does.
        """
        identified = self._identified
        found = commands_for(identified, wanted, surroundings, self._history, after=self._last)
        if not found.solved.all() and self._last is not None:  # not near the last ones at all
            found = commands_for(identified, wanted, surroundings, self._history)
        if keep and found.solved.all():
            self.sent(found)
        return found

    def sent(self, commands: Commands) -> None:
        """Let commands that were only asked for count as sent."""
        identified = self._identified
        history, whole = commands.history, identified.remembers_path
        if identified.effects:
            self._history = history.condensed(identified.motion, whole_path=whole)
        else:  # nothing looks back
            self._history = History(history.extension[:, -1:], history.time_s[-1:])
        self._last = commands

    def blocks(
        self, wanted: Array, period_s: float, surroundings: Surroundings | None = None
    ) -> Iterator[Array]:
        """Actuator coordinates q (n, B) of poses (k, N), ``period_s`` apart, block by block.

        The times of the poses follow that of ``surroundings`` (or the history's last).

        Raises
        ------
        BadInput
            For a pose that is refused, with its number; those before it have been given.
        """
        for found in self._solved(wanted, period_s, surroundings):
            yield found.q

    def rows(
        self,
        wanted: Array,
        period_s: float,
        surroundings: Surroundings | None = None,
        *,
        acceleration: Array,
    ) -> Array:
        """All actuator coordinates q (N, n) at once, as drives can follow them.

        As :meth:`blocks`, but lost motion is not taken up within a period: over so long that half
        of ``acceleration`` (n,), mm/s^2 or rad/s^2, does (:mod:`calib.command.easing`).

        Raises
        ------
        BadInput
            As :meth:`blocks` does.
        """
        identified = self._identified
        found = list(self._solved(wanted, period_s, surroundings))
        extension, plain = (
            np.concatenate([getattr(one, name) for one in found], axis=1)
            for name in ("extension", "plain")
        )
        half = 0.5 * np.asarray(acceleration, dtype=np.float64)
        easy = eased(extension, plain, period_s, half, identified.motion)
        return np.ascontiguousarray((easy + identified.reference).T)

    def _solved(
        self, wanted: Array, period_s: float, surroundings: Surroundings | None
    ) -> Iterator[Commands]:
        around = surroundings or Surroundings()
        begins = self._history.time_s[-1] if around.time_s is None else np.max(around.time_s)
        for first in range(0, wanted.shape[1], BLOCK):
            part = wanted[:, first : first + BLOCK]
            times = begins + period_s * (1.0 + first + np.arange(part.shape[1]))
            found = self.solve(part, Surroundings(around.channels, times))
            for number, why in enumerate(found.refused):
                if why:
                    raise BadInput(
                        f"pose {first + number + 1} of the trajectory: {why}",
                        remedy="Leave the pose out, or move it inward",
                    )
            yield found
