"""Drives that move together: a :class:`drivers.interface.Motors` on CANopen.

All set-points and speeds are written before anything moves; then one frame a drive, back to back,
starts them: at 500 kbit/s six frames take 1.5 ms. In mode ``cyclic`` SYNC starts and paces them.
"""

import asyncio
from collections.abc import Callable, Sequence

from drivers.canopen.drive402 import (
    ACTUAL_POSITION,
    DISABLE_VOLTAGE,
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
from drivers.drives.profiled import start_profiles
from drivers.drives.rest import at_rest
from drivers.drives.sync import must_take_setpoints
from drivers.drives.targets import in_counts, table_of
from drivers.drives.travel import Travel
from drivers.errors import DeviceError, Refused
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity
from drivers.stopping import confirmed

HOMING_DEADLINE_S = 120.0


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
            self._stream = Stream(bus)

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
        counts = in_counts(self._bus, q)
        async with self._moving:
            await self._must_be_ready()
            if self._stream is not None and self._stream.plays:
                raise _under_way()
            stands = self._travel is None or self._travel.over
            starts = await asyncio.gather(*(d.read(ACTUAL_POSITION) for d in self._bus.drives))
            self._end_travel()
            self._targets = {a.name: value for a, value in zip(self._bus.axes, q, strict=True)}
            try:
                if self._stream is not None:
                    self._stream.go(counts)
                else:
                    await start_profiles(self._bus, counts, starts, self._must_not_be_stopped)
            except DeviceError:
                await self._bus.send_stop()
                raise
            self._travel = Travel(self._bus, self._stream, starts, counts, straight=stands)

    @property
    def accelerations(self) -> tuple[float, ...]:
        """Largest acceleration of each actuator, mm/s^2 or rad/s^2."""
        return tuple(axis.acceleration for axis in self._bus.axes)

    async def play_actuators(self, rows: Sequence[Sequence[float]], every_s: float) -> None:
        """Start along ``rows`` (N, A) of q, one each ``every_s`` seconds; mode ``cyclic`` only.

        :meth:`wait_arrived` waits for its end. Raises Refused, before anything moves, if it does
        not begin where the machine is held, passes limits, speed or acceleration, or if another
        motion is under way.
        """
        self.check()
        if self._stream is None:
            raise Refused(
                "drives that make their own profiles cannot play a trajectory", device="drives",
                remedy='Write mode = "cyclic" under [controller].',
            )  # fmt: skip
        async with self._moving:
            await self._must_be_ready()
            if self._travel is not None and not self._travel.over:
                raise _under_way()
            table = table_of(self._bus, rows, every_s, self._stream.held)
            self._end_travel()
            names = (axis.name for axis in self._bus.axes)
            self._targets = dict(zip(names, map(float, rows[-1]), strict=True))
            self._stream.play(table)
            ends = table.rows[-1]
            self._travel = Travel(self._bus, self._stream, ends, ends, straight=False)

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
        if self._stream is not None:
            await asyncio.gather(*(must_take_setpoints(drive) for drive in self._bus.drives))

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

    def stop_at_once(self) -> None:
        """Quick stop from any thread, without waiting for rest; never raises."""
        self._bus.stop_at_once()

    async def stop(self) -> None:
        """Quick stop, at any moment and from any state; never raises for a second call.

        Whole frames go out at once, past every SDO transfer under way. The drives brake as 0x605A
        says; :meth:`enable` brings them back. Raises LinkLost if the frames cannot be sent, Silence
        if the machine does not come to rest, HeartbeatLost of a drive that cannot be asked.
        """
        again, self._stopped = self._stopped, True
        async with confirmed(again):
            await self._bus.send_stop()
            self._end_stream()
            await at_rest(self._bus, self.state)

    # ------------------------------------------------------------ the end

    async def close(self) -> None:
        """Take the power off, let the nodes stop watching this PC, release the link."""
        self._end_stream()
        self._end_travel()
        await self._bus.leave()


def _under_way() -> Refused:
    return Refused(
        "another motion is under way",
        device="drives",
        remedy="Wait for its end, or stop the machine.",
    )
