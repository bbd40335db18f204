"""What a driver is tested on: a device that stands ready, and what can be done to it."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from drivers.errors import DeviceError
from drivers.interface import MotionController, Motors, PoseMover, Tracker
from drivers.kind import ActuatorFacts

POSE_AXES = (("x", "mm"), ("y", "mm"), ("z", "mm"), ("rx", "rad"), ("ry", "rad"), ("rz", "rad"))
"""Axes of a controller that takes poses, as its state names them."""
Act = Callable[[], Awaitable[None]]
Point = tuple[float, float, float]


class BrokenLaw(AssertionError):
    """A driver does not hold a law."""


@dataclass(frozen=True)
class TrackerBench:
    """A tracker with an SMR in its beam.

    Attributes
    ----------
    open : coroutine function
        Connects a new driver; called once for each law.
    longest_s : float
        Wall seconds in which every call must have ended, with an answer or an error.
    target : coroutine function
        Where the SMR is, tracker frame, mm; None where nobody knows.
    hide, silence : coroutine functions
        Step into the beam; let the device answer nothing more. None where that cannot be done.
    """

    open: Callable[[], Awaitable[Tracker]]
    longest_s: float
    target: Callable[[], Awaitable[Point]] | None = None
    hide: Act | None = None
    silence: Act | None = None


@dataclass(frozen=True)
class ControllerBench:
    """A controller whose machine may move.

    Attributes
    ----------
    open, longest_s, silence
        As of :class:`TrackerBench`; ``longest_s`` covers a move between the two poses.
    actuators : tuple of ActuatorFacts
        As the driver was told of them.
    poses : two tuples
        Two poses that it can reach, some seconds of its motion apart; the first near its home.
    unreachable : tuple
        A pose that it must refuse.
    parameter : str
        A parameter that may be changed a little; empty where it holds none.
    settle_s : float
        Wall seconds after which a machine that was stopped stands.
    """

    open: Callable[[], Awaitable[MotionController]]
    longest_s: float
    actuators: tuple[ActuatorFacts, ...]
    poses: tuple[tuple[float, ...], tuple[float, ...]]
    unreachable: tuple[float, ...]
    parameter: str = ""
    silence: Act | None = None
    settle_s: float = 1.0

    @property
    def axes(self) -> tuple[tuple[str, str], ...]:
        """Names and units of its actuators."""
        return tuple((actuator.name, actuator.unit) for actuator in self.actuators)

    async def connect(self) -> MotionController:
        """A new driver."""
        return await self.open()

    async def start(self, device: MotionController, which: int) -> None:
        """Start moving to one of the two poses."""
        await device.move_to_pose(self.poses[which])

    async def start_out_of_reach(self, device: MotionController) -> None:
        """Ask for the pose that it must refuse."""
        await device.move_to_pose(self.unreachable)

    async def start_nan(self, device: MotionController) -> None:
        """Ask for what is no pose."""
        await device.move_to_pose((math.nan, *self.poses[0][1:]))


@dataclass(frozen=True)
class PoseBench:
    """A controller that takes poses, whose machine may move.

    Attributes
    ----------
    open, longest_s, poses, unreachable, silence, settle_s
        As of :class:`ControllerBench`; poses as :class:`~drivers.interface.PoseMover` takes them.
    """

    open: Callable[[], Awaitable[PoseMover]]
    longest_s: float
    poses: tuple[tuple[float, ...], tuple[float, ...]]
    unreachable: tuple[float, ...]
    silence: Act | None = None
    settle_s: float = 1.0

    @property
    def axes(self) -> tuple[tuple[str, str], ...]:
        """Names and units of its axes."""
        return POSE_AXES

    async def connect(self) -> PoseMover:
        """A new driver."""
        return await self.open()

    async def start(self, device: PoseMover, which: int) -> None:
        """Start moving to one of the two poses."""
        await device.move_pose(self.poses[which])

    async def start_out_of_reach(self, device: PoseMover) -> None:
        """Ask for the pose that it must refuse."""
        await device.move_pose(self.unreachable)

    async def start_nan(self, device: PoseMover) -> None:
        """Ask for what is no pose."""
        await device.move_pose((math.nan, *self.poses[0][1:]))


@dataclass(frozen=True)
class MotorsBench:
    """Drives that take actuator values, whose machine may move.

    Attributes
    ----------
    open, longest_s, actuators, silence, settle_s
        As of :class:`ControllerBench`; the move between the places should last a second or more.
    places : two tuples
        Two values of q, the first near home; the actuators' ways between them all differ.
    unreachable : tuple
        A value of q of which one actuator's is outside its limits.
    stall : coroutine function
        Block the last actuator in its way; None where that cannot be done.
    """

    open: Callable[[], Awaitable[Motors]]
    longest_s: float
    actuators: tuple[ActuatorFacts, ...]
    places: tuple[tuple[float, ...], tuple[float, ...]]
    unreachable: tuple[float, ...]
    silence: Act | None = None
    stall: Act | None = None
    settle_s: float = 1.0

    @property
    def axes(self) -> tuple[tuple[str, str], ...]:
        """Names and units of its actuators."""
        return tuple((actuator.name, actuator.unit) for actuator in self.actuators)

    async def connect(self) -> Motors:
        """A new driver."""
        return await self.open()

    async def start(self, device: Motors, which: int) -> None:
        """Start moving to one of the two places."""
        await device.move_actuators(self.places[which])

    async def start_out_of_reach(self, device: Motors) -> None:
        """Ask for the place that it must refuse."""
        await device.move_actuators(self.unreachable)

    async def start_nan(self, device: Motors) -> None:
        """Ask for what is no place."""
        await device.move_actuators((math.nan, *self.places[0][1:]))


BenchT = TypeVar("BenchT", TrackerBench, ControllerBench, MotorsBench, PoseBench)


@dataclass(frozen=True)
class Law(Generic[BenchT]):
    """One law; ``needs`` names attributes of ``can`` and of the bench without which it is mute."""

    says: str
    run: Callable[[BenchT], Coroutine[Any, Any, None]]
    needs: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.says


async def why_not(law: Law[Any], bench: Any) -> str:
    """Why a law cannot be run on a bench; empty if it can."""
    wanting = [name for name in law.needs if hasattr(bench, name) and not getattr(bench, name)]
    if wanting:
        return f"the bench has no {wanting[0]}"
    asked = [name for name in law.needs if not hasattr(bench, name)]
    if asked:
        device = await bench.open()
        can = device.can
        await device.close()
        lacking = [name for name in asked if not getattr(can, name)]
        if lacking:
            return f"the device cannot: {lacking[0]}"
    return ""


def hold(true: bool, otherwise: str) -> None:
    """Raise :class:`BrokenLaw` unless something is true."""
    if not true:
        raise BrokenLaw(otherwise)


async def refuses(deed: Awaitable[Any], within_s: float, what: str) -> DeviceError:
    """The DeviceError with which a deed ends; a deed that succeeds or waits on breaks a law."""
    try:
        async with asyncio.timeout(within_s):
            await deed
    except DeviceError as error:
        hold(bool(error.what), f"{what}: the error has no words")
        return error
    except TimeoutError:
        raise BrokenLaw(f"{what}: nothing came within {within_s:g} s") from None
    raise BrokenLaw(f"{what}: it was accepted")
