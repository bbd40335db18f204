"""LinuxCNC with genhexkins as a :class:`drivers.interface.MotionController`.

Poses go as G-code (MDI): millimetres, degrees, R = Rz(C) Ry(B) Rx(A). q is the distance of the
joint centres, what a joint counts less what genhexkins adds for the turn of its screw.
"""

import asyncio
from collections.abc import Callable, Mapping

from drivers.errors import DeviceError
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity
from drivers.kind import Surroundings
from drivers.linuxcnc.link import Answer, LinuxCncLink
from drivers.linuxcnc.motion import Motion
from drivers.linuxcnc.parameter_access import POWER_S, ParameterAccess
from drivers.linuxcnc.places import Places
from drivers.linuxcnc.stored import Stored
from drivers.linuxcnc.watch import Watch

RETRY_S = 0.5


class LinuxCncController:
    """One LinuxCNC; made by :meth:`connect`."""

    def __init__(self, around: Surroundings, places: Places, stored: Stored) -> None:
        self.can = ControllerCan()
        self.identity = Identity(
            "linuxcnc", "LinuxCNC", stored.ini.get("KINS", "KINEMATICS"), stored.machine
        )
        self._settings = around.settings
        self._actuators = around.actuators
        self._places, self._stored = places, stored
        self._device = f"linuxcnc {stored.machine}"
        self._callbacks: list[Callable[[Alarm], None]] = []
        self._said: list[str] = []
        self._link: LinuxCncLink
        self._parameters = ParameterAccess(self._ask, places, self._device)
        self._watch = Watch(self._ask, self._on_fault, self._device)
        self._motion = Motion(
            self._ask, around, places, self._parameters, self._watch, self._said, self._device
        )
        self._closed = False

    @classmethod
    async def connect(cls, around: Surroundings) -> "LinuxCncController":
        """Find LinuxCNC, and make sure that it is the one of the site file. Nothing moves.

        Raises
        ------
        ConnectFailed
            If no LinuxCNC runs here.
        Refused
            For another INI file or other kinematics, units or joint normals than are expected, and
            for joints that cannot find their reference again.
        """
        places = Places.of(tuple(around.parameters), around.struts)
        stored = Stored.of(around.settings, places)
        controller = cls(around, places, stored)
        await controller._open()
        return controller

    async def _open(self) -> None:
        settings = self._settings
        self._link = await LinuxCncLink.open(
            settings["python"], settings["env"], self._device, settings["silence_s"], self._said
        )
        try:
            state = await self._link.ask("state")
            self._stored.check(state)
            self._places.check(await self._parameters.pins())
        except BaseException:
            await self._link.close()
            raise
        self._watch.begin(on=bool(state["on"]))

    async def _ask(self, do: str, within_s: float | None = None, **arguments: object) -> Answer:
        return await self._link.ask(do, within_s, **arguments)

    # ------------------------------------------------------------ alarms

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""
        self._callbacks.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing (LinuxCNC gone, emergency stop, switched off)."""
        self._watch.check()

    def _on_fault(self, fault: DeviceError) -> None:
        for callback in self._callbacks:
            callback(Alarm(self._device, fault.what, fault.remedy, fault=True))

    # ------------------------------------------------------------ state

    async def state(self) -> ControllerState:
        """Read a snapshot."""
        state = await self._ask("state")
        added = await self._motion.added()
        actuators = []
        for n, facts in enumerate(self._actuators):
            position = state["joints"][n] - added[n]
            commanded = state["commanded"][n] - added[n]
            target = self._motion.targets[n] if self._motion.targets is not None else commanded
            homing = bool(state["homing"][n])
            actuators.append(
                ActuatorState(
                    facts.name, position, target, _word(state), homing or self._motion.under_way,
                    bool(state["homed"][n]),
                )
            )  # fmt: skip
        moving = self._motion.moves(state)
        return ControllerState(tuple(actuators), moving, bool(state["on"]), {})

    async def channels(self) -> dict[str, float]:
        """It has no sensors of its own."""
        return {}

    # ------------------------------------------------------------ power

    async def enable(self) -> None:
        """Machine on; raises DeviceFault while it is held in emergency stop, Refused."""
        self.check()
        state = await self._ask("state")
        if not state["on"]:
            await self._ask("reset", POWER_S)
            await self._ask("on", POWER_S)
            state = await self._ask("state")
        if state["estop"]:
            raise self._watch.in_estop()
        if not state["on"]:
            raise self._motion.refused("does not switch on", "Look at its own screen")
        self._watch.expect(on=True)

    async def disable(self) -> None:
        """Stop what moves, and machine off."""
        self._watch.expect(on=False)
        self._motion.targets = None
        await self._ask("off", POWER_S)

    async def clear_faults(self) -> None:
        """Leave emergency stop if what holds it lets go; raises the fault that stays."""
        self._watch.expect(on=False)
        await self._ask("reset", POWER_S)
        await self._ask("off", POWER_S)
        if (await self._ask("state"))["estop"]:
            raise self._watch.in_estop()
        self._watch.clear()

    # ------------------------------------------------------------ motion

    async def home(self, actuator: str) -> None:
        """Let one joint find its home switch; raises Refused, DriveFault, DeviceFault."""
        await self._motion.home(actuator)

    async def move_to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """Command a pose and start moving; returns the lengths of the struts there.

        They are worked out from the pins that genhexkins uses; :meth:`wait_arrived` compares them
        with where LinuxCNC has sent the joints. Raises Refused, or the fault that stands.
        """
        return await self._motion.to_pose(pose)

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until LinuxCNC stands at the pose; ``timeout`` in wall seconds.

        Raises DeviceFault if the motion was stopped, if it did not end, or if the joints were sent
        elsewhere than the pins say; LinkLost if LinuxCNC is gone.
        """
        await self._motion.arrived(timeout)

    async def stop(self) -> None:
        """Stop all motion, at any moment; never raises for a second call."""
        await self._motion.stop()

    # ------------------------------------------------------------ parameters

    async def read_parameters(self) -> dict[str, float]:
        """Read every parameter from the pins, bit for bit."""
        return await self._parameters.read()

    async def write_parameters(self, values: Mapping[str, float]) -> None:
        """Set the pins, read them back bit for bit, and forget the joints' references.

        The machine must be off: genhexkins uses new pins at once, and the motors would step.
        Raises Refused (with the name of the parameter) or ParameterError.
        """
        await self._parameters.write(values)

    async def parameter_checksum(self) -> int:
        """CRC-32 over the parameters as the pins have them."""
        return await self._parameters.checksum()

    async def store_parameters(self) -> None:
        """Write the pins into the HAL file and the INI file; the old files stay beside them."""
        pins = await self._parameters.pins()
        await asyncio.to_thread(self._stored.write, pins)

    async def reload_parameters(self) -> None:
        """Start LinuxCNC again, or read what is stored and set the pins to it."""
        if (await self._ask("state"))["on"]:
            raise self._parameters.is_on()
        if self._settings["restart"]:
            await self._restart()
            return
        before = await self._parameters.pins()
        await self._parameters.load(self._stored.pins(before), before)

    async def _restart(self) -> None:
        await self._watch.end()
        await self._link.close()
        await self._stored.restart(self._device)
        self._watch.clear()
        deadline = asyncio.get_running_loop().time() + self._settings["restart_s"]
        while True:
            try:
                await self._open()
                return
            except DeviceError:
                if asyncio.get_running_loop().time() > deadline:
                    raise
            await asyncio.sleep(RETRY_S)

    # ------------------------------------------------------------ the end

    async def close(self) -> None:
        """Machine off, and the helper ends; never raises."""
        if self._closed:
            return
        self._closed = True
        await self._watch.end()
        try:
            await self._ask("off", self._settings["silence_s"])
        except DeviceError as error:
            for callback in self._callbacks:
                callback(Alarm(self._device, f"closed without a farewell ({error.what})"))
        await self._link.close()


def _word(state: Answer) -> str:
    """The machine's state in a word."""
    return "emergency stop" if state["estop"] else "on" if state["on"] else "off"
