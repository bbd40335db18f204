"""Machine time: a clock that runs faster than the wall's by a constant scale.

Physics and dwells run on machine time; heartbeats and socket deadlines run on wall time.
"""

import threading
import time
from typing import Protocol


class Clock(Protocol):
    """What the physics asks of time."""

    @property
    def scale(self) -> float:
        """Machine seconds per wall second."""

    def now(self) -> float:
        """Machine time in s since the station started."""


class ScaledClock:
    """``scale`` machine seconds pass in each wall second.

    Parameters
    ----------
    scale : float
        1 is real time; 120 makes two hours pass in a minute.
    start : float
        Machine time at construction, s.
    """

    def __init__(self, scale: float = 1.0, start: float = 0.0) -> None:
        if not scale > 0.0:
            raise ValueError(f"the clock's scale must be positive, got {scale}")
        self.scale = scale
        self._start = start
        self._origin = time.monotonic()

    def now(self) -> float:
        """Machine time in s since the station started."""
        return self._start + self.scale * (time.monotonic() - self._origin)

    def wall(self, machine_s: float) -> float:
        """Wall seconds that ``machine_s`` machine seconds take."""
        return machine_s / self.scale


class ManualClock:
    """A clock that stands still until it is told to go on: for tests and simulations."""

    def __init__(self, start: float = 0.0, scale: float = 1.0) -> None:
        self.scale = scale
        self._now = start
        self._lock = threading.Lock()

    def now(self) -> float:
        """Machine time in s."""
        with self._lock:
            return self._now

    def advance(self, seconds: float) -> None:
        """Let ``seconds`` of machine time pass."""
        with self._lock:
            self._now += seconds
