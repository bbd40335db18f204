"""Whether a drive follows its set-points: one that does not hear them says nothing."""

import time

from drivers.drives.axis import Axis
from drivers.drives.bus import DriveBus
from drivers.errors import DriveFault

STANDS = 4
"""A drive that has not moved by so many windows stands; one as far from its set-point lags."""


class Follower:
    """One drive under set-points, from the beginning of a motion."""

    def __init__(self, axis: Axis, bus: DriveBus) -> None:
        self._axis = axis
        self._windows = STANDS * bus.window(axis)
        self._silence_s = bus.link.address.silence_s
        self._where: int | None = None
        self._since = 0.0

    def look(self, counts: int, setpoint: int) -> None:
        """Raise DriveFault once it stands for ``silence_s`` beside its set-point."""
        now = time.monotonic()
        moves = self._where is None or abs(counts - self._where) > self._windows
        if moves or abs(setpoint - counts) <= self._windows:
            self._where, self._since = counts, now
        elif now - self._since > self._silence_s:
            short = abs(setpoint - counts) / abs(self._axis.scale)
            raise DriveFault(
                f"stands {short:.3g} {self._axis.unit} from its set-point for "
                f"{self._silence_s:g} s: it does not hear SYNC, or is blocked",
                device=f"drive {self._axis.name} (node {self._axis.node})",
                remedy="Check that it takes RPDO 2 at SYNC, and that nothing holds it.",
            )
