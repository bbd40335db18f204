"""A mock controller on a small machine of three legs, without the rest of a station."""

import asyncio
import contextlib
import time
from dataclasses import dataclass, field
from pathlib import Path

from drivers.gcs import GcsController
from drivers.interface import Alarm
from mocks.clock import ScaledClock
from mocks.faults import FaultSet
from mocks.gcs.server import GcsStation
from mocks.physics.motion import LegMotion

SCALE = 100.0
HOME = (0.0, 0.0, -121.24355652982142, 0.0, 0.0, 0.0)
LOW = (10.0, -20.0, -150.0, 0.0, 0.0, 0.0)


class SmallMachine:
    """Three sliders, faults and channels: what the controller asks of a world."""

    def __init__(self, scale: float = SCALE) -> None:
        self.clock = ScaledClock(scale)
        self.legs = [LegMotion(self.clock) for _ in range(3)]
        self.faults = FaultSet()
        self.payload_kg = 1.5

    def structure_temp_C(self) -> float:  # noqa: N802
        return 20.25

    @property
    def moving(self) -> bool:
        return any(leg.moving for leg in self.legs)


@dataclass
class Bench:
    """A running station, the driver connected to it, and what it said unasked."""

    world: SmallMachine
    station: GcsStation
    nvm: Path
    port: str
    alarms: list[Alarm] = field(default_factory=list)
    controller: GcsController | None = None

    @property
    def driver(self) -> GcsController:
        assert self.controller is not None
        return self.controller

    async def connect(self, **options: object) -> GcsController:
        self.controller = await GcsController.connect(self.port, **options)
        self.controller.on_alarm(self.alarms.append)
        return self.controller

    async def slow_move(self) -> None:
        """Start a move that takes several wall seconds."""
        controller = self.driver
        await controller.enable()
        await controller._link.call(lambda line: line.command("VEL A 0.03 B 0.03 C 0.03"))
        await controller.move_to_pose(LOW)
        await until(lambda: self.world.moving)


def tcp_port(station: GcsStation) -> str:
    host, port = station.address
    return f"socket://{host}:{port}"


async def until(true, timeout: float = 20.0) -> None:
    deadline = time.monotonic() + timeout
    while not true():
        assert time.monotonic() < deadline
        await asyncio.sleep(0.005)


@contextlib.contextmanager
def running(station: GcsStation):
    station.start()
    try:
        yield station
    finally:
        station.stop()
