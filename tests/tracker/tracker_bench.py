from dataclasses import dataclass, field

import numpy as np

from drivers.emscon import EmsconTracker
from drivers.interface import Alarm
from mocks.tracker.server import TrackerServer
from mocks.world import World

SCALE = 200.0


@dataclass
class Bench:
    """A mock tracker in this process, on a real socket, and our driver connected to it."""

    world: World
    server: TrackerServer
    tracker: EmsconTracker
    alarms: list[Alarm] = field(default_factory=list)

    def nest(self, name: str) -> tuple[float, float, float]:
        """True place of a nest now, tracker frame."""
        now = np.array([self.world.clock.now()])
        x, y, z = self.world.nest_in_tracker(name, now)[0]
        return float(x), float(y), float(z)
