"""A lab without wires, for laws of single routines: devices that answer from what stands there."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from zlib import crc32

import numpy as np
from session_mock import POSES, site_text

from app.clock import Clock
from app.files.pose_table import Pose
from app.files.site import Site, parse_site
from app.files.site_devices import Hands
from app.files.site_limits import Limits
from app.session.answered import expected_targets
from app.session.plan import Plan
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from app.session.station import Devices
from calib.frames import Frame, nest_in_base
from drivers.errors import DeviceError, NoTarget
from drivers.interface import (
    ActuatorState,
    Alarm,
    ControllerCan,
    ControllerState,
    Identity,
    TrackerCan,
    TrackerReading,
    TrackerState,
)

SCALE = 1e4
"""Machine seconds in a wall second: half an hour's patience in less than a second."""
NEAR_MM = 20.0
COVARIANCE = (1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0)
QUICK = PlanOptions(order="pose-by-pose", warm_up=False, two_face=False)


@dataclass
class Room:
    """What is really there, and what happens to it."""

    site: Site
    frame: Frame
    """The base as it stands in the tracker's frame."""
    smrs: set[str]
    """Nests that hold an SMR."""
    air_temp_C: Callable[[], float] = lambda: 20.0
    pose: Pose = ()
    log: list[str] = field(default_factory=list)
    fault: DeviceError | None = None

    def sees(self, nest: str) -> np.ndarray:
        """Where the tracker sees an SMR in a nest, mm."""
        if nest in self.site.base_nests:
            return self.frame.apply(nest_in_base((0.0,) * 6, self.site.base_nests[nest]))
        return self.frame.apply(nest_in_base(self.pose, self.site.platform_nests[nest]))


class Silent:
    """What both devices have."""

    def __init__(self, room: Room) -> None:
        self.room = room
        self.stop_fails: DeviceError | None = None

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Say nothing unasked."""

    def check(self) -> None:
        if self.room.fault is not None:
            raise self.room.fault

    async def stop(self) -> None:
        self.room.log.append(f"stop {type(self).__name__}")
        if self.stop_fails is not None:
            raise self.stop_fails

    async def close(self) -> None:
        """Nothing is open."""


class LabController(Silent):
    """Is where it was sent at once; q are those of the drawing."""

    can = ControllerCan()
    identity = Identity("canopen", serial="17")

    def __init__(self, room: Room) -> None:
        super().__init__(room)
        self.held = {p.name: p.nominal for p in room.site.machine.parameters}
        self.q: tuple[float, ...] = (230.0,) * 6
        self.moving = False
        self.enabled = True

    async def state(self) -> ControllerState:
        one = [ActuatorState(f"q{i}", q, q, "", self.moving, True) for i, q in enumerate(self.q)]
        return ControllerState(tuple(one), self.moving, self.enabled)

    async def enable(self) -> None:
        self.enabled = True

    async def disable(self) -> None:
        self.enabled = False

    async def move_to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        self.room.log.append("move")
        self.room.pose = tuple(pose)
        self.q = tuple(expected_targets(self.room.site.machine, self.held, pose))
        return self.q

    async def wait_arrived(self, timeout: float) -> None:
        """It is there."""

    async def channels(self) -> dict[str, float]:
        return {"air_temp_C": self.room.air_temp_C()}

    async def read_parameters(self) -> dict[str, float]:
        return dict(self.held)

    async def write_parameters(self, values: dict[str, float]) -> None:
        self.held |= values

    async def parameter_checksum(self) -> int:
        return crc32(repr(sorted(self.held.items())).encode())


class LabTracker(Silent):
    """Sees without noise whatever SMR is nearest to where it was pointed."""

    can = TrackerCan(points=True, reflectors=True)
    identity = Identity("emscon", serial="5")

    def __init__(self, room: Room) -> None:
        super().__init__(room)
        self.fails: list[DeviceError] = []
        """What the next dwells end with instead of a reading."""
        self.initialized = True
        self.warm_after = 0
        self._on = ""

    async def state(self) -> TrackerState:
        self.warm_after -= 1
        return TrackerState(self.initialized, True, True, self.warm_after < 0, "", 0)

    async def initialize(self) -> None:
        self.room.log.append("initialize")
        self.initialized = True

    async def select_reflector(self, name: str) -> None:
        self.room.log.append(f"reflector {name}")

    async def point_at(self, xyz: tuple[float, float, float]) -> None:
        self.room.log.append("point")
        distance = {n: np.linalg.norm(self.room.sees(n) - xyz) for n in self.room.smrs}
        nearest = min(distance, key=distance.__getitem__)
        if distance[nearest] > NEAR_MM:
            raise NoTarget("no reflector is there", device="tracker")
        self._on = nearest

    async def measure(self, dwell_s: float) -> TrackerReading:
        if self.fails:
            raise self.fails.pop(0)
        self.room.log.append(f"measure {self._on}")
        x, y, z = (float(value) for value in self.room.sees(self._on))
        return TrackerReading((x, y, z), COVARIANCE)

    async def channels(self) -> dict[str, float]:
        return {}


@dataclass
class Lab:
    """A session whose devices are those of the room."""

    room: Room
    controller: LabController
    tracker: LabTracker
    session: Session


@cache
def lab_site() -> Site:
    """The site file of a lab that does not exist."""
    return parse_site(site_text(smrs=3), "site.toml", Path())


def lab_in(
    folder: Path, *, plan: Plan | None = None, hands: dict | None = None, limits: dict | None = None
) -> Lab:
    """A session that is connected to a room in which every nest holds an SMR."""
    site = lab_site()
    site = replace(
        site,
        clock_scale=SCALE,
        limits=replace(Limits(), **(limits or {})),
        hands=Hands(**{**vars(site.hands), **(hands or {})}),
    )
    frame = Frame.of(site.tracker.frame)
    nests = {*site.platform_nests, *site.base_nests}
    room = Room(site, frame, nests, pose=site.machine.home)
    controller, tracker = LabController(room), LabTracker(room)
    plan = plan or measure_plan(site, {label: POSES[label] for label in "ab"}, QUICK)
    session = Session.create(site, plan, folder, unattended=True)
    session.station._devices = Devices(controller, tracker)
    assert isinstance(session.station.clock, Clock)
    for smr, nest in enumerate(site.platform_nests, start=1):
        session.work.smr_brought(smr, nest)
    return Lab(room, controller, tracker, session)
