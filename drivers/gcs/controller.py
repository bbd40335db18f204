"""A motion controller that speaks GCS 2.0, on a serial line or TCP.

:class:`GcsController` is a :class:`drivers.interface.MotionController`. Commands, identifiers and
what a controller must offer: docs/protocols/gcs.md.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping

from drivers.errors import DeviceError, DriveFault, Refused
from drivers.gcs.answers import numbers
from drivers.gcs.axes import MOVING, SERVO, TRIPOD, Axes, state_name
from drivers.gcs.connect import check_limits, recognise
from drivers.gcs.layout import groups_of
from drivers.gcs.line import Line
from drivers.gcs.link import GcsLink
from drivers.gcs.motion import Motion
from drivers.gcs.parameter_access import ParameterAccess
from drivers.gcs.watch import Watch
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity

SINGLE_MOTION_S, FAREWELL_S = 60.0, 1.5


class GcsController:
    """One controller; made by :meth:`connect`.

    Alarms come for every fault that :meth:`check` would raise: the controller is asked five times
    a second how it is. Faults stand until :meth:`clear_faults`; after a lost link only a new
    :meth:`connect` helps.
    """

    def __init__(
        self, link: GcsLink, identity: Identity, parameters: ParameterAccess, axes: Axes
    ) -> None:
        self.identity = identity
        self.can = ControllerCan(channels=tuple(parameters.layout.channels))
        self.axes = axes
        self._link = link
        self._device = link.device
        self._parameters = parameters
        watchdog_ms = round(2000.0 * link.silence_s) if parameters.layout.watchdog else 0
        self._watch = Watch(link, axes, parameters, watchdog_ms)
        self._motion = Motion(link, axes, self._watch)
        self._callbacks: list[Callable[[Alarm], None]] = []
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
        parameters: Iterable[str] = (),
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
            identity, layout = await link.call(
                lambda line: recognise(line, serial, groups_of(parameters))
            )
            if limits:
                wanted = {axes.actuators[name]: pair for name, pair in limits.items()}
                await link.call(lambda line: check_limits(line, wanted))
            access = ParameterAccess(layout, link.device, level, store_password)
            controller = cls(link, identity, access, axes)
            await link.call(controller._watch.begin)
        except BaseException:
            await link.close()
            raise
        link.look = controller._watch.look
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

    # ------------------------------------------------------------ state

    async def state(self) -> ControllerState:
        """Read a snapshot."""

        def read(line: Line) -> tuple[tuple[float, ...], ...]:
            asked = (line.query(f"{what} {self.axes.words}") for what in ("POS?", "MOV?", "FRF?"))
            return tuple(numbers(lines, self.axes.driven, self._device) for lines in asked)

        bits = await self._watch.registers()
        positions, targets, referenced = await self._link.call(read)
        actuators = tuple(
            ActuatorState(
                name=name,
                position=positions[n],
                target=targets[n],
                state=state_name(bits[n]),
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
        return "SVO " + " ".join(f"{axis} {int(on)}" for axis in self.axes.driven)

    async def enable(self) -> None:
        """Switch all servos on; raises DriveFault, Refused, Silence.

        If one of them cannot be switched on, the others are switched off again.
        """
        self.check()
        stops = self._link.line.stops
        try:
            await self._link.call(lambda line: line.command(self._switch(True), stops=stops))
            bits = await self._watch.registers()
            self.check()
        except DriveFault:
            await self.disable()
            await self._watch.registers()
            self.check()
            raise
        off = [n for n, word in zip(self.axes.actuators, bits, strict=True) if not word & SERVO]
        if off:
            raise Refused(
                f"does not switch on the servos of {', '.join(off)}",
                device=self._device,
                remedy="Check the enable inputs and the supply.",
            )
        self._motion.switched_on(stops)

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
        await self._link.call(self._watch.begin)
        await self.disable()
        self._link.clear_faults()
        await self._watch.registers()
        self.check()

    # ------------------------------------------------------------ motion

    async def home(self, actuator: str) -> None:
        """Run one actuator's reference move; raises Refused, DriveFault, DeviceFault, Silence."""
        await self._motion.reference(self._axis(actuator), SINGLE_MOTION_S)

    async def jog(self, actuator: str, q: float) -> None:
        """Move one actuator alone to ``q`` and wait until it is there."""
        self._motion.check_numbers((q,), 1, "q")
        await self._motion.to({self._axis(actuator): q})
        await self._motion.arrived(SINGLE_MOTION_S)

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
        await self._motion.to_position(pose)
        return self._motion.targets

    async def move_to_q(self, q: tuple[float, ...]) -> None:
        """Command all actuators together and start moving; raises Refused."""
        self._motion.check_numbers(q, len(self.axes.actuators), "q")
        await self._motion.to(dict(zip(self.axes.driven, q, strict=True)))

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until every drive reports its target reached; ``timeout`` in wall seconds.

        Raises DriveFault or HeartbeatLost (that fault), DeviceFault if the motion was stopped,
        Silence at the deadline, LinkLost.
        """
        await self._motion.arrived(timeout)

    def stop_at_once(self) -> None:
        """Stop all motion (#24) from any thread, without waiting for rest; never raises."""
        self._link.stop_at_once()

    async def stop(self) -> None:
        """Stop all motion (#24), at any moment; never raises for a second call.

        The byte goes out at once, past every exchange under way; the servos are switched off when
        everything is at rest, and :meth:`enable` brings them back. Raises LinkLost or Silence if
        the stop could not be sent or the machine does not come to rest.
        """
        await self._motion.stop(self._switch(False))

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
        self._watch.end(line)
