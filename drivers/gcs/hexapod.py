"""A closed hexapod behind GCS 2.0: it takes poses and shows no parameters.

:class:`GcsHexapod` is a :class:`drivers.interface.PoseMover`. Nothing here knows a leg; what a
controller must offer: docs/closed-hexapods.md.
"""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.errors import ConnectFailed, DeviceError, Refused
from drivers.gcs.answers import by_item, numbers
from drivers.gcs.connect import greet
from drivers.gcs.conventions import Convention
from drivers.gcs.hexapod_motion import HexapodMotion
from drivers.gcs.line import Line
from drivers.gcs.link import GcsLink
from drivers.gcs.pose_frame import PoseFrame, need_frame, need_unit, read_frame, said, set_frame
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity

FAREWELL_S, START_S = 1.5, 30.0
OURS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Wishes:
    """What the site file says of a closed hexapod.

    Attributes
    ----------
    axes : sequence of str
        What it calls x, y, z and the turns about them.
    convention : Convention
        How it writes poses down.
    frame : PoseFrame
        To what they must refer.
    set_frame : bool
        Whether to set that, where it is otherwise.
    velocity_mm_s : float
        Of the platform; 0 leaves it as it is.
    keep_servo : bool
        Whether its servos stay on when the program ends.
    """

    axes: Sequence[str]
    convention: Convention
    frame: PoseFrame
    set_frame: bool = False
    velocity_mm_s: float = 0.0
    keep_servo: bool = False


class GcsHexapod:
    """One closed hexapod; made by :meth:`connect`.

    It is asked five times a second whether its servos are on; faults stand until
    :meth:`clear_faults`. It has no watchdog for this PC: a move that was begun goes to its end.
    """

    def __init__(self, link: GcsLink, identity: Identity, wishes: Wishes) -> None:
        self.identity = identity
        self.can = ControllerCan(parameters=False, homes=True)
        self._link = link
        self._device = link.device
        self._wishes = wishes
        self._motion = HexapodMotion(link, wishes.axes)
        self._callbacks: list[Callable[[Alarm], None]] = []
        link.on_fault = self._on_fault

    @classmethod
    async def connect(
        cls, port: str, baudrate: int, wishes: Wishes, *, serial: str = "", silence_s: float = 1.0
    ) -> "GcsHexapod":
        """Open the line, recognise the controller and check to what its poses refer.

        Nothing moves. ``silence_s``: wall time without an answer after which it counts as lost.

        Raises
        ------
        ConnectFailed
            The port does not open, nobody answers, or who answers has other axes.
        Silence
            It does not get ready.
        Refused
            Another serial number, unit, pivot or coordinate system than the site file says.
        """
        link = await GcsLink.open(port, baudrate, silence_s)
        try:
            identity = await link.call(lambda line: greet(line, serial or None, "gcs-hexapod"))
            hexapod = cls(link, identity, wishes)
            await hexapod._motion.ready(START_S)
            await link.call(hexapod._begin)
        except BaseException:
            await link.close()
            raise
        link.look = hexapod._motion.look
        return hexapod

    def _begin(self, line: Line) -> None:
        wishes, there = self._wishes, line.query("SAI?")
        missing = [axis for axis in wishes.axes if axis not in there]
        if missing:
            raise ConnectFailed(
                f"has the axes {' '.join(there)}, not {' '.join(missing)}",
                device=self._device,
                remedy="Correct axes in the site file, or connect the right machine",
            )
        need_unit(line, wishes.axes, wishes.convention.degrees)
        if wishes.set_frame and read_frame(line).against(wishes.frame):
            set_frame(line, wishes.frame)
        need_frame(line, wishes.frame)
        if wishes.velocity_mm_s:
            line.command(f"VLS {wishes.velocity_mm_s!r}")
        self._motion.read_limits(line)

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""
        self._callbacks.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing (link lost, controller silent, servo off), if any."""
        self._link.check()

    def _on_fault(self, fault: DeviceError) -> None:
        for callback in self._callbacks:
            callback(Alarm(fault.device, fault.what, fault.remedy, fault=True))

    # ------------------------------------------------------------ state

    async def state(self) -> ControllerState:
        """Read a snapshot; its actuators are x, y, z in mm and rx, ry, rz in rad, as we write."""

        def read(line: Line) -> tuple[tuple[float, ...], tuple[float, ...], list[bool], bool, bool]:
            axes = self._wishes.axes
            place, target, known, servo = (
                numbers(line.query(f"{what} {' '.join(axes)}"), axes, self._device)
                for what in ("POS?", "MOV?", "FRF?", "SVO?")
            )
            return place, target, [bool(k) for k in known], all(servo), line.moving()

        place, target, known, servo, moving = await self._link.call(read)
        convention = self._wishes.convention
        fault = self._link.faults.get("drive")
        actuators = tuple(
            ActuatorState(
                name, position, aim, "servo on" if servo else "servo off", moving, homed,
                "" if fault is None else fault.what,
            )
            for name, position, aim, homed in zip(
                OURS, convention.read(place), convention.read(target), known, strict=True
            )
        )  # fmt: skip
        return ControllerState(actuators, moving, servo)

    async def channels(self) -> dict[str, float]:
        """Read nothing: it has no sensors to tell of."""
        self.check()
        return {}

    async def frame(self) -> dict[str, str]:
        """What its poses refer to: coordinate system and pivot as they are, the rest as stated."""
        found = await self._link.call(read_frame)
        convention = self._wishes.convention
        return {
            "system": found.system,
            "pivot": said(found.pivot),
            "rotation": convention.order,
            "angle_unit": "deg" if convention.degrees else "rad",
            "origin": said(convention.origin),
            "axes": " ".join(self._wishes.axes),
        }

    async def coordinate_systems(self) -> dict[str, str]:
        """Which coordinate systems are active, with their types (``KEN?``)."""
        return await self._link.call(lambda line: by_item(line.query("KEN?"), self._device))

    # ------------------------------------------------------------ power

    async def enable(self) -> None:
        """Switch the servos on; raises DriveFault, Refused, Silence."""
        await self._motion.enable()

    async def disable(self) -> None:
        """Switch the servos off; what still moves is stopped."""
        await self._motion.disable()

    async def clear_faults(self) -> None:
        """Reset standing faults; the servos are off then.

        Raises Silence if the controller still does not answer, LinkLost if the link is gone.
        """
        if "link" in self._link.faults:
            self._link.check()
        await self._link.call(lambda line: line.synchronise())
        await self.disable()
        self._link.clear_faults()
        self.check()

    # ------------------------------------------------------------ motion

    async def home(self, actuator: str) -> None:
        """Run the reference move, which is that of all axes; raises Refused, DeviceFault."""
        if actuator not in OURS:
            raise Refused(
                f"there is no axis {actuator!r}",
                device=self._device,
                remedy=f"Name one of {', '.join(OURS)}; they find their reference together",
            )
        await self._motion.reference()

    async def move_pose(self, pose: tuple[float, ...]) -> None:
        """Start moving to a pose as we write it, if its poses still mean what they should.

        Raises Refused (no such pose, limits, not enabled, another pivot or coordinate system than
        wanted) or the standing fault.
        """
        self._motion.check_numbers(pose, len(OURS), "a pose")
        wishes = self._wishes
        await self._motion.to(
            wishes.convention.written(pose), lambda line: need_frame(line, wishes.frame)
        )

    async def commanded_pose(self) -> tuple[float, ...]:
        """The pose that it says it was last told to go to (``MOV?``)."""
        return self._wishes.convention.read(await self._motion.target())

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until it is on target; ``timeout`` in wall seconds.

        Raises DriveFault or HeartbeatLost (that fault), DeviceFault if the motion was stopped,
        Silence at the deadline, LinkLost.
        """
        await self._motion.arrived(timeout)

    def stop_at_once(self) -> None:
        """Stop all motion (#24) from any thread, without waiting for rest; never raises."""
        self._link.stop_at_once()

    async def stop(self) -> None:
        """Stop all motion (#24), at any moment; never raises for a second call.

        The servos stay on: a platform that carries something is held. Raises LinkLost or Silence
        if the stop could not be sent or the machine does not come to rest.
        """
        await self._motion.stop()

    # ------------------------------------------------------------ the end

    async def close(self) -> None:
        """Stop, take the power off unless it shall stay, release the line; never raises."""
        if self._link.closed:
            return
        self._link.look = None
        if not self._link.faults.keys() & {"link", "silent"}:
            try:
                await asyncio.wait_for(self._farewell(), FAREWELL_S)
            except (DeviceError, TimeoutError) as error:
                what = f"closed without a farewell ({error}); a move goes to its end"
                for callback in self._callbacks:
                    callback(Alarm(self._device, what))
        await self._link.close()

    async def _farewell(self) -> None:
        if await self._link.call(lambda line: line.moving()):
            await self._link.stop()
        if not self._wishes.keep_servo:
            await self.disable()
