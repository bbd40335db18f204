"""Drives alone behind an adapter on TCP."""

import contextlib
from collections.abc import AsyncIterator, Callable, Iterator

import pytest
from bare_lab import Bare

from drivers.errors import DeviceError
from mocks.canopen.server import CanopenStation
from mocks.clock import ScaledClock
from mocks.world import World, WorldPlan


@pytest.fixture
def start_bare() -> Iterator[Callable[[float], Bare]]:
    with contextlib.ExitStack() as stack:

        def start(scale: float) -> Bare:
            world = World(ScaledClock(scale), WorldPlan(seed=4))
            station = CanopenStation(world, bare=True)
            station.start()
            stack.callback(station.stop)
            return Bare(world, station)

        yield start


@pytest.fixture
async def bare(start_bare: Callable[[float], Bare]) -> AsyncIterator[Bare]:
    """A machine in real time."""
    one = start_bare(1.0)
    yield one
    for motors in one.opened:
        with contextlib.suppress(DeviceError):
            await motors.close()
