import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from drivers.emscon import EmsconTracker
from drivers.interface import Alarm, TrackerReading
from mocks.clock import ScaledClock
from mocks.tracker.server import TrackerServer
from mocks.world import World, WorldPlan

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

    async def in_dwell(self, dwell_s: float = 600.0) -> "asyncio.Task[TrackerReading]":
        """A dwell that has begun on the instrument; by default one of several wall seconds."""
        dwell = asyncio.create_task(self.tracker.measure(dwell_s))
        await until(lambda: self.server.instrument.measuring.running)
        return dwell


async def until(true: Callable[[], bool], timeout: float = 20.0) -> None:
    """Wait for a condition."""
    async with asyncio.timeout(timeout):
        while not true():  # noqa: ASYNC110 - a plain value, not an event
            await asyncio.sleep(0.001)


@contextmanager
def tracker_in_a_thread() -> Iterator[str]:
    """Address of a mock tracker that answers while the test's own event loop does nothing."""
    clock = ScaledClock(SCALE)
    server = TrackerServer(World(clock, WorldPlan(seed=4, smrs=3)), clock)
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        asyncio.run_coroutine_threadsafe(server.start(), loop).result(10.0)
        yield server.address
    finally:
        asyncio.run_coroutine_threadsafe(server.stop(), loop).result(10.0)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(10.0)
        loop.close()
