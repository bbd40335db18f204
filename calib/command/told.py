"""What is told of commands before they are known: channels, times, and what they follow."""

from dataclasses import dataclass

from calib.arrays import Array, IntArray
from calib.command.history import Ahead, History
from calib.command.identified import Identified
from calib.command.rows import rows_at
from calib.command.surroundings import Surroundings
from calib.errors import BadInput
from calib.runs.stack import Rows


@dataclass(frozen=True, eq=False)
class Told:
    """N commands of which all is told but where they are.

    ``alternatives``: none of them follows another.
    """

    identified: Identified
    channels: dict[str, Array]
    ahead: Ahead
    alternatives: bool

    @property
    def time_s(self) -> Array:
        """When (N,), s."""
        return self.ahead.time_s[self.ahead.at]

    @classmethod
    def of(
        cls,
        identified: Identified,
        surroundings: Surroundings,
        history: History,
        steps: IntArray,
    ) -> "Told":
        """Gather it; ``steps`` as for :meth:`History.ahead`.

        Raises
        ------
        BadInput
            If a channel is missing without which an effect has no value, or times go back.
        """
        count = steps.size
        channels = {name: surroundings.channel(name, count) for name in surroundings.channels}
        for name in identified.needs:
            if name not in channels:
                who = next(f.effect.id for f in identified.effects if name in f.needs)
                raise BadInput(
                    f"the effect {who} depends on {name}, and that is not told",
                    remedy=f"Say what {name} is",
                )
        if identified.needs_time and surroundings.time_s is None:
            who = next(f.effect.id for f in identified.effects if "time_s" in f.effect.depends)
            raise BadInput(
                f"the effect {who} depends on the time, and that is not told", remedy="Say time_s"
            )
        ahead = history.ahead(surroundings.times(count), identified.motion, steps)
        return cls(identified, channels, ahead, bool((steps < 0).all()))

    def rows(self, extension: Array) -> Rows:
        """Rows of these commands at extensions (n, N), as if they had been read."""
        path, at = self.ahead.path(extension), self.ahead.at
        known = self.identified
        return rows_at(known.machine, known.run, path, at, self.channels, known.reference)
