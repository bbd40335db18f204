"""A mock of a closed hexapod on six legs, without the rest of a station."""

import asyncio
import time
from dataclasses import dataclass, field

from drivers.gcs.hexapod import GcsHexapod
from drivers.gcs.pose_kind import KIND
from drivers.interface import Alarm, PoseMover
from drivers.kind import Surroundings
from mocks.clock import ScaledClock
from mocks.faults import FaultSet
from mocks.gcs.server import GcsStation
from mocks.physics.circumstances import MILLIMETRES
from mocks.physics.motion import LegMotion

SCALE = 100.0
SETTINGS = {
    "baudrate": 115200, "axes": list("XYZUVW"), "angle_unit": "deg", "rotation": "Rx Ry Rz",
    "origin": (0.0, 0.0, 220.0), "pivot": (0.0, 0.0, 0.0), "system": ["ZERO"], "set_frame": False,
    "velocity_mm_s": 0.0, "keep_servo": False, "silence_s": 1.0,
}  # fmt: skip
HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)
THERE = (6.0, -8.0, 226.0, 0.10, -0.12, 0.16)


class SixLegs:
    """Six legs, faults and channels: what the controller asks of a world."""

    kind = "hexapod"
    stroke = MILLIMETRES
    payload_kg = 0.0

    def __init__(self, scale: float = SCALE) -> None:
        self.clock = ScaledClock(scale)
        self.legs = [LegMotion(self.clock) for _ in range(6)]
        self.faults = FaultSet()

    def structure_temp_C(self) -> float:  # noqa: N802
        return 20.0

    @property
    def moving(self) -> bool:
        return any(leg.moving for leg in self.legs)


@dataclass
class HexapodBench:
    """A running station, the driver connected to it, and what it said unasked."""

    world: SixLegs
    station: GcsStation
    port: str
    alarms: list[Alarm] = field(default_factory=list)
    mover: GcsHexapod | None = None

    @property
    def driver(self) -> GcsHexapod:
        assert self.mover is not None
        return self.mover

    async def connect(self, serial: str = "", **changes: object) -> GcsHexapod:
        settings = {**SETTINGS, "port": self.port, **changes}
        opened: PoseMover = await KIND.open(
            Surroundings(settings, serial, "hexapod", (), {}, self.world.clock.scale)
        )
        assert isinstance(opened, GcsHexapod)
        opened.on_alarm(self.alarms.append)
        self.mover = opened
        return opened

    async def ready(self, **changes: object) -> GcsHexapod:
        """Connected, with power and a reference."""
        mover = await self.connect(**changes)
        await mover.enable()
        await mover.home("x")
        return mover

    def obey(self, line: str) -> str:
        """What somebody else types into the controller, or presses on its panel."""
        with self.station._lock:
            return self.station._commands.obey(line)


async def until(true, timeout: float = 20.0) -> None:
    deadline = time.monotonic() + timeout
    while not true():
        assert time.monotonic() < deadline
        await asyncio.sleep(0.005)
