from collections.abc import AsyncIterator

import pytest
from tracker_bench import SCALE, Bench

from drivers.emscon import EmsconTracker
from drivers.emscon.settings import EmsconSettings
from mocks.clock import ScaledClock
from mocks.tracker.server import TrackerServer
from mocks.world import World, WorldPlan


@pytest.fixture
async def bench() -> AsyncIterator[Bench]:
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(seed=4, smrs=3))
    server = TrackerServer(world, clock)
    await server.start()
    settings = EmsconSettings(margin_s=1.0)
    tracker = await EmsconTracker.connect(server.address, SCALE, settings)
    made = Bench(world, server, tracker)
    tracker.on_alarm(made.alarms.append)
    yield made
    await tracker.close()
    await server.stop()


@pytest.fixture
async def locked(bench: Bench) -> Bench:
    """The same, initialised and locked on the SMR in nest 3."""
    await bench.tracker.initialize()
    await bench.tracker.select_reflector("CCR-1.5in")
    await bench.tracker.point_at(bench.nest("3"))
    return bench
