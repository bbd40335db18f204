"""Drives that move together: a :class:`drivers.interface.Motors` on CANopen.

All set-points and speeds are written before anything moves; then one frame a drive, back to back,
starts them: at 500 kbit/s six frames take 1.5 ms. In mode ``cyclic`` SYNC starts and paces them.
"""

import asyncio
import math
import time
from collections.abc import Callable

from drivers.canopen.drive402 import (
    ACTUAL_POSITION,
    AT_ONCE,
    DISABLE_VOLTAGE,
    ENABLE,
    NEW_SETPOINT,
    STATUSWORD,
    TARGET_POSITION,
    Drive402,
    state_name,
)
from drivers.canopen.link import CanLink
from drivers.drives.axis import Axis
from drivers.drives.bus import DriveBus, check_files
from drivers.drives.cyclic import Stream
from drivers.drives.plan import Plan
from drivers.drives.profile import Profile
from drivers.drives.travel import Travel
from drivers.errors import DeviceError, LinkError, Refused, Silence
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity

HOMING_DEADLINE_S = 120.0
REST_DEADLINE_S = 3.0
POLL_S = 0.01
PROFILE_VELOCITY, PROFILE_ACCELERATION, PROFILE_DECELERATION = 0x6081, 0x6083, 0x6084


class DriveMotors:
    """The drives of one machine; made by :meth:`connect`.

    A drive in fault, a silent one or one that restarts stops all. Faults stand until
    :meth:`clear_faults`; after a lost link only a new :meth:`connect` helps.
    """

    def __init__(self, bus: DriveBus, identity: Identity) -> None:
        self.identity = identity
        self.can = ControllerCan(parameters=False, homes=True)
        self._bus = bus
        self._plan = bus.plan
        self._homed: set[str] = set()
        self._homing = ""
        self._stopped = False
        self._targets: dict[str, float] = {}
        self._travel: Travel | None = None
        self._moving: asyncio.Lock = asyncio.Lock()
        self._stream: Stream | None = None
        if bus.plan.cyclic:
            self._stream = Stream(bus.link, bus.drives, bus.plan.sync_s, bus.plan.time_scale)

    @classmethod
    async def connect(cls, plan: Plan) -> "DriveMotors":
        """Open the bus, recognise every drive, set it up and watch it. Nothing moves.

        Raises
        ------
        ConnectFailed
            No adapter, no answer from a node, or no heartbeat.
        Refused
            Another device than its EDS file describes, units that disagree, or a drive that cannot
            be told to stop when this PC dies.
        DeviceError
            An EDS file that is none.
        """
        check_files(plan)
        link = await CanLink.open(plan.address)
        try:
            bus = DriveBus(link, plan)
            identity = await bus.recognise()
            motors = cls(bus, identity)
            await motors._check_place()
            await bus.watch()
            await bus.note_faults()
        except BaseException:
            await link.close()
            raise
        return motors

    async def _check_place(self) -> None:
        """Refuse a drive that knows where it is and says that this is out of its limits."""
        for actuator, axis in zip((await self.state()).actuators, self._bus.axes, strict=True):
            low, high = axis.limits
            spare = 0.05 * (high - low)
            if actuator.homed and not low - spare <= actuator.position <= high + spare:
                raise Refused(
                    f"stands at {actuator.position:.6g} {axis.unit}, outside {low:g} to {high:g}",
                    device=f"drive {axis.name} (node {axis.node})",
                    remedy="Check sign, offset and counts_per_unit under [controller].",
                )

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""
        self._bus.callbacks.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing (link lost, heartbeat lost, drive fault), if any."""
        self._bus.link.check()

    # ------------------------------------------------------------ state

    async def state(self) -> ControllerState:
        """Read a snapshot."""
        pairs = list(zip(self._bus.drives, self._bus.axes, strict=True))
        actuators = await asyncio.gather(*(self._actuator(drive, axis) for drive, axis in pairs))
        moving = any(actuator.moving for actuator in actuators)
        enabled = all(actuator.state == "operation enabled" for actuator in actuators)
        return ControllerState(tuple(actuators), moving, enabled)

    async def _actuator(self, drive: Drive402, axis: Axis) -> ActuatorState:
        word, counts, homed = await drive.remote.call(lambda: self._look(drive))
        fault = self._bus.link.faults.get(f"drive {drive.remote.id}")
        position, state = axis.to_q(counts), state_name(word)
        travelling = self._travel is not None and not self._travel.over
        return ActuatorState(
            name=axis.name,
            position=position,
            target=self._targets.get(axis.name, position),
            state=state,
            moving=(travelling and state == "operation enabled")
            or self._homing == axis.name
            or state == "quick stop active",
            homed=homed,
            fault=fault.what if fault is not None else "",
        )

    def _look(self, drive: Drive402) -> tuple[int, int, bool]:
        """Statusword, position and whether the reference is known; blocking."""
        word, counts = drive.read_now(STATUSWORD), drive.read_now(ACTUAL_POSITION)
        how = self._plan.referenced
        if how.always:
            return word, counts, True
        if not how.index:
            return word, counts, drive.name in self._homed
        held = word if how.index == STATUSWORD else drive.read_now(how.index, how.sub)
        return word, counts, bool(held >> how.bit & 1)

    async def channels(self) -> dict[str, float]:
        """Drives have no channels."""
        return {}

    # ------------------------------------------------------------ power

    async def enable(self) -> None:
        """Bring all drives to operation enabled, each with its set-point where it stands.

        If one of them cannot, the others are switched off again. Raises DriveFault, Silence,
        Refused.
        """
        self.check()
        self._travel = None
        try:
            await asyncio.gather(*(self._hold(drive) for drive in self._bus.drives))
            if self._stream is not None:
                self._stream.start([await d.read(ACTUAL_POSITION) for d in self._bus.drives])
            mode = self._bus.mode
            walks = (drive.enable(mode) for drive in self._bus.drives)
            failures = [f for f in await asyncio.gather(*walks, return_exceptions=True) if f]
            if failures:
                raise failures[0]
        except DeviceError:
            self._end_stream()
            await self._bus.send_stop(DISABLE_VOLTAGE)
            raise
        self._stopped = False

    async def _hold(self, drive: Drive402) -> None:
        """Set the set-point to where the drive stands: a cyclic mode would run to an old one."""
        await drive.write(TARGET_POSITION, await drive.read(ACTUAL_POSITION))

    def _end_stream(self) -> None:
        if self._stream is not None:
            self._stream.stop()

    async def disable(self) -> None:
        """Take the power off all drives."""
        self._end_stream()
        await asyncio.gather(*(drive.disable() for drive in self._bus.drives))

    async def clear_faults(self) -> None:
        """Reset standing faults; motion stays disabled until :meth:`enable`.

        What a drive forgot when it was switched off is set up anew, and its reference counts as
        unknown. Raises DriveFault if a drive stays in fault, ConnectFailed if one stays silent, and
        LinkLost if the link is gone.
        """
        for drive in self._bus.drives:
            if f"restart {drive.remote.id}" in self._bus.link.faults:
                self._homed.discard(drive.name)
        await self._bus.clear()

    # ------------------------------------------------------------ motion

    async def home(self, actuator: str) -> None:
        """Run one actuator's homing; raises Refused, DriveFault, Silence."""
        self.check()
        n = next((n for n, axis in enumerate(self._bus.axes) if axis.name == actuator), None)
        if n is None:
            raise Refused(
                f"there is no actuator {actuator!r}",
                device="drives",
                remedy=f"Name one of {', '.join(axis.name for axis in self._bus.axes)}.",
            )
        drive = self._bus.drives[n]
        async with self._moving:
            self._homing = actuator
            self._homed.discard(actuator)
            self._targets.pop(actuator, None)
            try:
                await drive.home(HOMING_DEADLINE_S, None)
                await self._hold(drive)
                if self._stream is not None:
                    self._stream.hold(n, await drive.read(ACTUAL_POSITION))
                await drive.set_mode(self._bus.mode)
            finally:
                self._homing = ""
            self._homed.add(actuator)

    async def move_actuators(self, q: tuple[float, ...]) -> None:
        """Start moving every actuator to ``q``; all start and arrive together.

        Raises Refused (a value outside the limits, not enabled, a reference that is not known)
        before any of them moves; DriveFault or Silence after all were stopped.
        """
        self.check()
        counts = self._in_counts(q)
        async with self._moving:
            await self._must_be_ready()
            starts = await asyncio.gather(*(d.read(ACTUAL_POSITION) for d in self._bus.drives))
            ways = [
                (target - start) / axis.scale
                for target, start, axis in zip(counts, starts, self._bus.axes, strict=True)
            ]
            profile = Profile.of(self._bus.axes, ways)
            self._end_travel()
            self._targets = {a.name: value for a, value in zip(self._bus.axes, q, strict=True)}
            try:
                if self._stream is not None:
                    self._stream.go(counts, profile)
                else:
                    await self._start_profiles(counts, ways, profile)
            except DeviceError:
                await self._bus.send_stop()
                raise
            self._travel = Travel(self._bus, self._stream, starts, counts)

    def _in_counts(self, q: tuple[float, ...]) -> list[int]:
        if len(q) != len(self._bus.axes) or not all(map(math.isfinite, q)):
            raise Refused(
                f"{len(self._bus.axes)} finite values are wanted, got {q}",
                device="drives",
                remedy="Nothing was commanded.",
            )
        counts = []
        for value, axis in zip(q, self._bus.axes, strict=True):
            low, high = self._bus.soft_limits(axis)
            target = axis.to_counts(value)
            if not low <= target <= high:
                lowest, highest = sorted((axis.to_q(low), axis.to_q(high)))
                raise Refused(
                    f"{axis.name} = {value:.6g} {axis.unit} is outside {lowest:.6g} to "
                    f"{highest:.6g}",
                    device=f"drive {axis.name} (node {axis.node})",
                    remedy="Nothing was commanded. Choose values within the limits; they are the "
                    "narrower of the site file's and those that 0x607D held at connect.",
                )
            counts.append(target)
        return counts

    async def _must_be_ready(self) -> None:
        for actuator in (await self.state()).actuators:
            device = f"drive {actuator.name}"
            if actuator.state != "operation enabled":
                raise Refused(
                    f"is in state {actuator.state!r}", device=device,
                    remedy="Enable the machine first.",
                )  # fmt: skip
            if not actuator.homed:
                raise Refused("does not know its reference", device=device, remedy="Home it first.")

    async def _start_profiles(self, counts: list[int], ways: list[float], profile: Profile) -> None:
        """Write what each drive shall do, then start all of them with one frame each."""
        drives = self._bus.drives

        async def prepare(drive: Drive402, axis: Axis, target: int, way: float) -> None:
            acceleration = profile.acceleration_of(axis, way)
            await drive.write(TARGET_POSITION, target)
            await drive.write(PROFILE_VELOCITY, profile.speed_of(axis, way))
            await drive.write(PROFILE_ACCELERATION, acceleration)
            if drive.has(PROFILE_DECELERATION):
                await drive.write(PROFILE_DECELERATION, acceleration)

        each = zip(drives, self._bus.axes, counts, ways, strict=True)
        await asyncio.gather(*(prepare(*one) for one in each))
        self._must_not_be_stopped()
        await self._bus.send_controlword(ENABLE | NEW_SETPOINT | AT_ONCE)
        await asyncio.gather(*(drive.acknowledge(True) for drive in drives))
        self._must_not_be_stopped()
        await self._bus.send_controlword(ENABLE)

    def _must_not_be_stopped(self) -> None:
        if self._stopped:
            raise Refused(
                "the motion was stopped before it began", device="drives",
                remedy="Enable the machine and start again.",
            )  # fmt: skip

    def _end_travel(self) -> None:
        if self._travel is not None:
            self._travel.cancel()
            self._travel = None

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until every drive has reached its target; ``timeout`` in wall seconds.

        Raises DriveFault or HeartbeatLost (that fault), DeviceFault if the motion was stopped,
        Silence at the deadline, LinkLost.
        """
        if self._travel is not None:
            await self._travel.wait(timeout)

    async def stop(self) -> None:
        """Quick stop, at any moment and from any state; never raises for a second call.

        Whole frames go out at once, past every SDO transfer under way. The drives brake as 0x605A
        says; :meth:`enable` brings them back. Raises LinkLost if the frames cannot be sent, Silence
        if the machine does not come to rest.
        """
        again, self._stopped = self._stopped, True
        try:
            await self._bus.send_stop()
            self._end_stream()
            await self._rest()
        except LinkError as error:
            if not again:
                raise type(error)(
                    f"the stop was not confirmed ({error.what})",
                    device=error.device,
                    remedy="Use the emergency stop. Drives stop by themselves without the PC.",
                ) from error

    async def _rest(self) -> None:
        """Wait until no drive has power and none moves; tell again one that still has it."""
        deadline = time.monotonic() + REST_DEADLINE_S
        before: list[float] = []
        while True:
            actuators = (await self.state()).actuators
            now = [actuator.position for actuator in actuators]
            on = [a for a in actuators if a.state == "operation enabled"]
            still = len(before) == len(now) and all(
                abs(one - two) <= 2.0 / abs(axis.scale)
                for one, two, axis in zip(before, now, self._bus.axes, strict=True)
            )
            if still and not on:
                return
            if time.monotonic() > deadline:
                raise Silence("the machine is still moving, or has power", device="drives")
            if on:
                await self._bus.send_stop()
            before = now
            await asyncio.sleep(POLL_S)

    # ------------------------------------------------------------ the end

    async def close(self) -> None:
        """Take the power off, let the nodes stop watching this PC, release the link."""
        self._end_stream()
        self._end_travel()
        await self._bus.leave()
