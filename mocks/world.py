"""The one physical machine behind a station's servers."""

import threading

from mocks.clock import Clock, ScaledClock
from mocks.faults import FaultSet
from mocks.physics.motion import LegMotion


class World:
    """Legs, temperature, payload and faults on one machine clock."""

    def __init__(self, clock: Clock | None = None, seed: int = 1) -> None:
        self.clock: Clock = clock or ScaledClock()
        self.seed = seed
        self.faults = FaultSet()
        self.legs = [LegMotion(self.clock) for _ in range(6)]
        self._lock = threading.RLock()
        self._payload_kg = 0.0

    @property
    def payload_kg(self) -> float:
        """Mass of the payload on the platform, kg."""
        return self._payload_kg

    @payload_kg.setter
    def payload_kg(self, mass: float) -> None:
        with self._lock:
            self._payload_kg = float(mass)

    def structure_temp_C(self) -> float:  # noqa: N802 (the unit's own capital)
        """Temperature of the machine's structure now, deg C, as its sensor reads it."""
        return 20.0
