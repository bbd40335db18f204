"""A motion controller that speaks GCS 2.0, on a serial line or TCP.

:class:`GcsController` is a :class:`drivers.interface.MotionController`. Commands, identifiers and
what a controller must offer: docs/protocols/gcs.md.
"""

import asyncio
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from drivers.errors import DeviceError, DeviceFault, DriveFault, LinkError, Refused, Silence
from drivers.gcs.answers import numbers, registers
from drivers.gcs.connect import check_limits, recognise
from drivers.gcs.layout import WATCHDOG
from drivers.gcs.line import ANSWER_S, Line
from drivers.gcs.link import GcsLink
from drivers.gcs.parameter_access import ParameterAccess
from drivers.interface import ActuatorState, Alarm, ControllerState, Identity

# Bits of status register 1.
ERROR, SERVO, MOVING, REFERENCING, ON_TARGET = 1 << 8, 1 << 12, 1 << 13, 1 << 14, 1 << 15
SINGLE_MOTION_S, REST_S, FAREWELL_S, POLL_S = 60.0, 2.0, 1.5, 0.005
# What a solver may leave of an angle that is meant to be 0.
LEVEL_RAD = 1e-6
REMEDY_SERVO = "Remove the cause, clear the faults and enable the machine again."


@dataclass(frozen=True)
class Axes:
    """Actuator name -> axis of the controller, and the axes of the platform's position."""

    actuators: Mapping[str, str]
    pose: Sequence[str]

    @property
    def sliders(self) -> list[str]:
        """Axes of the actuators, in their order."""
        return list(self.actuators.values())


TRIPOD = Axes({"q1": "A", "q2": "B", "q3": "C"}, "XYZ")


class GcsController:
    """One controller; made by :meth:`connect`.

    Alarms come for every fault that :meth:`check` would raise: the controller is asked five times
    a second how it is. Faults stand until :meth:`clear_faults`; after a lost link only a new
    :meth:`connect` helps.
    """

    def __init__(
        self,
        link: GcsLink,
        identity: Identity,
        parameters: ParameterAccess,
        axes: Axes,
        watchdog_ms: int,
    ) -> None:
        self.identity = identity
        self.axes = axes
        self._link = link
        self._device = link.device
        self._parameters = parameters
        self._watchdog_ms = watchdog_ms
        self._callbacks: list[Callable[[Alarm], None]] = []
        self._targets: tuple[float, ...] = ()
        self._stopped = False
        link.on_fault = self._on_fault

    @classmethod
    async def connect(
        cls,
        port: str,
        baudrate: int = 115200,
        *,
        axes: Axes = TRIPOD,
        serial: str | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
        level: str = "CCL 1 advanced",
        store_password: str = "100",
        silence_s: float = 1.0,
    ) -> "GcsController":
        """Open the line, recognise the controller and begin to watch it. Nothing moves.

        Parameters
        ----------
        port : str
            ``"COM3"``, ``"/dev/ttyUSB0"`` or ``"socket://192.168.0.5:50000"``.
        axes : Axes
            How the controller calls its axes.
        serial : str, optional
            Serial number that it must have (third field of ``*IDN?``).
        limits : mapping, optional
            Actuator -> (lowest, highest) q that the machine file allows; the controller's own
            limits must not be wider.
        silence_s : float
            Wall time without an answer after which the controller counts as lost. It itself stops
            when it has heard nothing for twice as long.

        Raises
        ------
        ConnectFailed
            The port does not open, or nobody answers there.
        Refused
            Another serial number or wider limits than expected.
        """
        link = await GcsLink.open(port, baudrate, silence_s)
        try:
            identity, layout = await link.call(lambda line: recognise(line, serial))
            if limits:
                wanted = {axes.actuators[name]: pair for name, pair in limits.items()}
                await link.call(lambda line: check_limits(line, wanted))
            access = ParameterAccess(layout, link.device, level, store_password)
            watchdog_ms = round(2000.0 * silence_s) if layout.watchdog else 0
            controller = cls(link, identity, access, axes, watchdog_ms)
            await link.call(controller._begin_watch)
        except BaseException:
            await link.close()
            raise
        link.look = controller._look
        return controller

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""
        self._callbacks.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing (link lost, controller silent, servo off), if any."""
        self._link.check()

    def _on_fault(self, fault: DeviceError) -> None:
        for callback in self._callbacks:
            callback(Alarm(fault.device, fault.what, fault.remedy, fault=True))

    # ------------------------------------------------------------ watching

    def _begin_watch(self, line: Line) -> None:
        if self._watchdog_ms:
            line.command(f"SPA 1 0x{WATCHDOG:X} {self._watchdog_ms}")

    def _look(self, line: Line, timeout: float) -> None:
        """Find servos in fault and a controller that was switched off meanwhile; in the worker."""
        self._note_faults(self._registers(line, timeout))
        if self._watchdog_ms and self._parameters.whole(line, WATCHDOG, timeout) == 0:
            self._link.latch(
                "restart",
                DeviceFault(
                    "was switched off and on: what was not stored is lost",
                    device=self._device,
                    remedy="Clear the faults, compare the parameters and enable the machine again.",
                ),
            )

    def _registers(self, line: Line, timeout: float = ANSWER_S) -> tuple[int, ...]:
        words = " ".join(f"{axis} 1" for axis in self.axes.sliders)
        answer = line.query(f"SRG? {words}", timeout)
        return registers(answer, self.axes.sliders, self._device)

    def _note_faults(self, bits: Sequence[int]) -> None:
        for name, axis, word in zip(
            self.axes.actuators, self.axes.sliders, bits, strict=True
        ):  # fmt: skip
            if word & ERROR:
                what = "the servo switched itself off (following error or hardware)"
                device = f"drive {name} (axis {axis})"
                fault = DriveFault(what, device=device, remedy=REMEDY_SERVO)
                self._link.latch(f"drive {name}", fault)

    async def _read_registers(self) -> tuple[int, ...]:
        bits = await self._link.call(self._registers)
        self._note_faults(bits)
        return bits

    # ------------------------------------------------------------ state

    async def state(self) -> ControllerState:
        """Read a snapshot."""

        def read(line: Line) -> tuple[tuple[float, ...], ...]:
            axes = " ".join(self.axes.sliders)
            asked = (line.query(f"{what} {axes}") for what in ("POS?", "MOV?", "FRF?"))
            return tuple(numbers(lines, self.axes.sliders, self._device) for lines in asked)

        bits = await self._read_registers()
        positions, targets, referenced = await self._link.call(read)
        actuators = tuple(
            ActuatorState(
                name=name,
                position=positions[n],
                target=targets[n],
                state=_state_name(bits[n]),
                moving=bool(bits[n] & MOVING),
                homed=bool(referenced[n]),
                fault=self._fault_of(name),
            )
            for n, name in enumerate(self.axes.actuators)
        )
        moving = any(word & MOVING for word in bits)
        enabled = all(word & SERVO for word in bits)
        return ControllerState(actuators, moving, enabled, await self.channels())

    def _fault_of(self, actuator: str) -> str:
        fault = self._link.faults.get(f"drive {actuator}")
        return fault.what if fault is not None else ""

    async def channels(self) -> dict[str, float]:
        """Read the controller's channels: ``structure_temp_C``, ``payload_kg``."""
        addresses = self._parameters.layout.channels
        return await self._link.call(lambda line: self._parameters.values(line, addresses))

    # ------------------------------------------------------------ power

    def _switch(self, on: bool) -> str:
        return "SVO " + " ".join(f"{axis} {int(on)}" for axis in self.axes.sliders)

    async def enable(self) -> None:
        """Switch all servos on; raises DriveFault, Refused, Silence.

        If one of them cannot be switched on, the others are switched off again.
        """
        self.check()
        stops = self._link.line.stops
        try:
            await self._link.call(lambda line: line.command(self._switch(True), stops=stops))
            bits = await self._read_registers()
            self.check()
        except DriveFault:
            await self.disable()
            await self._read_registers()
            self.check()
            raise
        off = [n for n, word in zip(self.axes.actuators, bits, strict=True) if not word & SERVO]
        if off:
            raise Refused(
                f"does not switch on the servos of {', '.join(off)}",
                device=self._device,
                remedy="Check the enable inputs and the supply.",
            )
        # A stop may have come meanwhile.
        self._stopped = stops != self._link.line.stops

    async def disable(self) -> None:
        """Take the power off all drives; what still moves is stopped."""
        await self._link.call(lambda line: line.command(self._switch(False)))

    async def clear_faults(self) -> None:
        """Reset standing faults; motion stays disabled until :meth:`enable`.

        Raises DriveFault if a servo stays in fault, Silence if the controller still does not
        answer, LinkLost if the link is gone.
        """
        if "link" in self._link.faults:
            self._link.check()
        await self._link.call(lambda line: line.synchronise())
        await self._link.call(self._begin_watch)
        await self.disable()
        self._link.clear_faults()
        await self._read_registers()
        self.check()

    # ------------------------------------------------------------ motion

    async def home(self, actuator: str) -> None:
        """Run one actuator's reference move; raises Refused, DriveFault, Silence."""
        self.check()
        axis = self._axis(actuator)
        await self._start(f"FRF {axis}")
        n = self.axes.sliders.index(axis)
        deadline = time.monotonic() + SINGLE_MOTION_S
        while (await self._read_registers())[n] & REFERENCING:
            self._link.check()
            self._need_time(deadline, SINGLE_MOTION_S)
            await asyncio.sleep(POLL_S)
        self._link.check()
        known = await self._link.call(lambda line: line.query(f"FRF? {axis}"))
        if not numbers(known, axis, self._device)[0]:
            raise DeviceFault(
                f"{actuator} was stopped before it found its reference",
                device=self._device,
                remedy="Enable the machine and home it again.",
            )

    async def jog(self, actuator: str, q: float) -> None:
        """Move one actuator alone to ``q`` and wait until it is there."""
        self._check_numbers((q,), 1, "q")
        await self._move({self._axis(actuator): q})
        await self.wait_arrived(SINGLE_MOTION_S)

    def _axis(self, actuator: str) -> str:
        if actuator not in self.axes.actuators:
            raise Refused(
                f"there is no actuator {actuator!r}",
                device=self._device,
                remedy=f"Name one of {', '.join(self.axes.actuators)}.",
            )
        return self.axes.actuators[actuator]

    async def move_to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """Command a pose and start moving; returns the controller's targets q.

        x, y, z in mm; three angles may follow and must be 0, for the platform cannot turn. Raises
        Refused (limits, unreachable, not enabled) or the standing fault.
        """
        count = len(self.axes.pose)
        position, turn = pose[:count], pose[count:]
        self._check_numbers(position, count, "pose")
        if any(abs(angle) > LEVEL_RAD for angle in turn):
            raise Refused(
                f"the platform cannot turn, the pose asks for {turn}",
                device=self._device,
                remedy="Command poses with rx = ry = rz = 0.",
            )
        await self._move(dict(zip(self.axes.pose, position, strict=True)))
        return self._targets

    async def move_to_q(self, q: tuple[float, ...]) -> None:
        """Command all actuators together and start moving; raises Refused."""
        self._check_numbers(q, len(self.axes.actuators), "q")
        await self._move(dict(zip(self.axes.sliders, q, strict=True)))

    async def _move(self, targets: Mapping[str, float]) -> None:
        self.check()
        words = " ".join(f"{axis} {float(value)!r}" for axis, value in targets.items())
        await self._start(f"MOV {words}")
        self._targets = await self._link.call(self._read_targets)

    async def _start(self, command: str) -> None:
        """Send what starts a motion, unless a stop comes first."""
        stops = self._link.line.stops
        if self._stopped:
            raise Refused(
                "the machine was stopped", device=self._device, remedy="Enable the machine first."
            )
        await self._link.call(lambda line: line.command(command, stops=stops))

    def _read_targets(self, line: Line) -> tuple[float, ...]:
        axes = self.axes.sliders
        return numbers(line.query(f"MOV? {' '.join(axes)}"), axes, self._device)

    def _check_numbers(self, values: tuple[float, ...], count: int, what: str) -> None:
        if len(values) != count or not all(map(math.isfinite, values)):
            raise Refused(
                f"{what} needs {count} finite numbers, got {values}",
                device=self._device,
                remedy="Nothing was commanded.",
            )

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until every drive reports its target reached; ``timeout`` in wall seconds.

        Raises DriveFault or HeartbeatLost (that fault), DeviceFault if the motion was stopped,
        Silence at the deadline, LinkLost.
        """
        deadline = time.monotonic() + timeout
        while True:
            bits = await self._read_registers()
            self._link.check()
            if not all(word & SERVO for word in bits):
                raise self._interrupted()
            if all(word & ON_TARGET and not word & MOVING for word in bits):
                break
            self._need_time(deadline, timeout)
            await asyncio.sleep(POLL_S)
        # A controller that was stopped is on target, too: where it stands.
        if await self._link.call(self._read_targets) != self._targets:
            raise self._interrupted()

    def _interrupted(self) -> DeviceFault:
        return DeviceFault(
            "the motion was stopped before it reached its target",
            device=self._device,
            remedy="Enable the machine and command the pose again.",
        )

    def _need_time(self, deadline: float, timeout: float) -> None:
        if time.monotonic() > deadline:
            raise Silence(
                f"the motion did not end within {timeout} s",
                device=self._device,
                remedy="Stop the machine and look at the actuators.",
            )

    async def stop(self) -> None:
        """Stop all motion (#24), at any moment; never raises for a second call.

        The byte goes out at once, past every exchange under way; the servos are switched off when
        everything is at rest, and :meth:`enable` brings them back. Raises LinkLost or Silence if
        the stop could not be sent or the machine does not come to rest.
        """
        again, self._stopped = self._stopped, True
        try:
            await self._link.stop()
            await self._rest()
            await self.disable()
        except LinkError as error:
            if not again:
                raise type(error)(
                    f"the stop was not confirmed ({error.what})",
                    device=error.device,
                    remedy="Use the emergency stop. The controller stops by itself without the PC.",
                ) from error

    async def _rest(self) -> None:
        deadline = time.monotonic() + REST_S
        while await self._link.call(lambda line: line.moving()):
            if time.monotonic() > deadline:
                raise Silence("the machine is still moving", device=self._device)
            await asyncio.sleep(POLL_S)

    # ------------------------------------------------------------ parameters

    async def read_parameters(self) -> dict[str, float]:
        """Read every kinematic parameter; raises ParameterError."""
        return await self._link.call(self._parameters.read)

    async def write_parameters(self, values: Mapping[str, float]) -> None:
        """Write to volatile memory, read back bit for bit; servos must be off.

        Raises Refused (with the name of the parameter) or ParameterError. What was written before
        a failure stays written: the caller restores its snapshot.
        """
        chosen = dict(values)
        await self._link.call(lambda line: self._parameters.write(line, chosen))

    async def parameter_checksum(self) -> int:
        """CRC-32 that the controller computes over the parameters that it uses now."""
        return await self._link.call(self._parameters.checksum)

    async def store_parameters(self) -> None:
        """Make the volatile parameters survive a power cycle; raises Refused."""
        await self._link.call(self._parameters.store)

    async def reload_parameters(self) -> None:
        """Bring the stored parameters back into use; servos must be off."""
        await self._link.call(self._parameters.reload)

    # ------------------------------------------------------------ the end

    async def close(self) -> None:
        """Take the power off, end the watch and release the line; never raises."""
        if self._link.closed:
            return
        self._link.look = None
        if not self._link.faults.keys() & {"link", "silent"}:
            try:
                await asyncio.wait_for(self._link.call(self._farewell), FAREWELL_S)
            except (DeviceError, TimeoutError) as error:
                what = f"closed without a farewell ({error}); it stops by itself"
                for callback in self._callbacks:
                    callback(Alarm(self._device, what))
        await self._link.close()

    def _farewell(self, line: Line) -> None:
        line.stop()
        line.command(self._switch(False))
        if self._watchdog_ms:
            line.command(f"SPA 1 0x{WATCHDOG:X} 0")


def _state_name(word: int) -> str:
    if word & ERROR:
        return "fault"
    return "servo on" if word & SERVO else "servo off"
