"""The program's own time: injected, so that a mock machine's two hours may take a minute."""

import time
from collections.abc import Callable
from datetime import UTC, datetime


class Clock:
    """Machine time in seconds since the start of a run: ``scale`` times wall time.

    Physics, dwells and every time stamp are in machine time; deadlines on sockets are wall time.

    Parameters
    ----------
    scale : float
        Machine seconds in one wall second; 1 on hardware.
    wall : callable
        Seconds of a clock that never goes back.
    utc : callable
        Time of day, for the journal.
    """

    def __init__(
        self,
        scale: float = 1.0,
        *,
        wall: Callable[[], float] = time.monotonic,
        utc: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.scale = scale
        self._wall = wall
        self._utc = utc
        self._zero = wall()

    def start_at(self, elapsed_s: float) -> None:
        """Let machine time be ``elapsed_s`` now: 0 for a new run, more for one that goes on."""
        self._zero = self._wall() - elapsed_s / self.scale

    def now(self) -> float:
        """Machine time, s."""
        return (self._wall() - self._zero) * self.scale

    def utc(self) -> str:
        """Time of day, ISO 8601 with milliseconds."""
        return self._utc().isoformat(timespec="milliseconds")

    def to_wall(self, machine_s: float) -> float:
        """Wall seconds that ``machine_s`` machine seconds take."""
        return machine_s / self.scale
