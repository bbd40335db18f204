"""Drives alone behind an adapter on TCP, and what connects to them."""

from dataclasses import dataclass, field
from typing import Any

from app.files.machines import load_machine
from drivers.drives.kind import KIND
from drivers.drives.motors import DriveMotors
from drivers.drives.plan import plan_of
from drivers.interface import Alarm
from drivers.kind import ActuatorFacts, Surroundings
from mocks.canopen.bare_drive import BareDrive
from mocks.canopen.bare_site import bare_site
from mocks.canopen.server import CanopenStation
from mocks.world import World

FACTS = tuple(
    ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in load_machine("hexapod").actuators
)
HOME = tuple(fact.home for fact in FACTS)
LOADED = 10.0
"""Seconds of silence that a machine with too much to do does not reach."""
SHORT = 0.6
"""The same where silence is what is tried."""
FAR = tuple(q + way for q, way in zip(HOME, (16.0, -3.0, 9.0, 12.0, -7.0, 5.0), strict=True))


@dataclass
class Bare:
    """A bare hexapod that runs, and the settings that its builder would write."""

    world: World
    station: CanopenStation
    opened: list[DriveMotors] = field(default_factory=list)
    alarms: list[Alarm] = field(default_factory=list)

    @property
    def channel(self) -> str:
        host, port = self.station.address
        return f"socket://{host}:{port}"

    def drive(self, number: int) -> BareDrive:
        drive = self.station.drives[number - 1]
        assert isinstance(drive, BareDrive)
        return drive

    @property
    def moving(self) -> bool:
        return any(leg.moving for leg in self.world.legs)

    def stated(self, **changes: Any) -> dict[str, Any]:
        """The builder's settings, with changes."""
        stated = bare_site(self.world, self.channel, self.station.serials)
        return stated | {"eds": [stated["eds"]], "silence_s": LOADED} | changes

    async def connect(self, serial: str = "", **changes: Any) -> DriveMotors:
        motors = await motors_of(self.stated(**changes), serial, self.world.clock.scale)
        motors.on_alarm(self.alarms.append)
        self.opened.append(motors)
        return motors

    async def ready(self, **changes: Any) -> DriveMotors:
        """Connected, on and homed."""
        motors = await self.connect(**changes)
        await motors.enable()
        for fact in FACTS:
            await motors.home(fact.name)
        return motors


async def motors_of(stated: dict[str, Any], serial: str = "", scale: float = 1.0) -> DriveMotors:
    """The driver of a machine, connected by its settings."""
    settings = {one.name: stated.get(one.name, one.default) for one in KIND.settings}
    return await DriveMotors.connect(
        plan_of(Surroundings(settings, serial, "hexapod", FACTS, {}, scale))
    )
