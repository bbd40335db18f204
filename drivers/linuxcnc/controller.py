"""LinuxCNC with genhexkins as a :class:`drivers.interface.MotionController`.

Poses go as G-code (MDI): millimetres, degrees, R = Rz(C) Ry(B) Rx(A). q is the distance of the
joint centres, what a joint counts less what genhexkins adds for the turn of its screw.
"""

import asyncio
import math
import zlib
from collections.abc import Callable, Mapping

from drivers.errors import DeviceError, DeviceFault, DriveFault, ParameterError, Refused
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity
from drivers.kind import Surroundings
from drivers.linuxcnc.link import Answer, LinuxCncLink
from drivers.linuxcnc.places import MUST_BE_ZERO, Places
from drivers.linuxcnc.rotation import matrix
from drivers.linuxcnc.stored import Stored
from drivers.linuxcnc.watch import Watch

AGREES_MM = 1e-6
"""How far LinuxCNC's joints may end from the lengths that its own pins give."""
FOUND_MM = 1e-3
"""How far the pose that it found may be from its joints."""
POLL_S = 0.02
POWER_S = 15.0
"""Seconds that a change of state may take; the helper waits for several, one after the other."""
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
        self._link: LinuxCncLink
        self._watch = Watch(self._ask, self._on_fault, self._device)
        self._targets: tuple[float, ...] | None = None
        self._under_way = False
        self._stops = 0
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
            settings["python"], settings["env"], self._device, settings["silence_s"]
        )
        try:
            state = await self._link.ask("state")
            self._stored.check(state)
            self._places.check(await self._pins())
        except BaseException:
            await self._link.close()
            raise
        self._watch.begin(on=bool(state["on"]))

    async def _ask(self, do: str, within_s: float | None = None, **arguments: object) -> Answer:
        return await self._link.ask(do, within_s, **arguments)

    async def _pins(self) -> dict[str, float]:
        places = self._places
        wanted = [*places.pins, *places.normals(), *MUST_BE_ZERO]
        try:
            return dict((await self._ask("get", pins=wanted))["values"])
        except Refused as error:
            raise Refused(
                f"a pin of genhexkins is missing ({error.what})",
                device=self._device,
                remedy="Load genhexkins in the HAL file: loadrt genhexkins",
            ) from error

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
        added = await self._added()
        actuators = []
        for n, facts in enumerate(self._actuators):
            position = state["joints"][n] - added[n]
            commanded = state["commanded"][n] - added[n]
            target = self._targets[n] if self._targets is not None else commanded
            homing = bool(state["homing"][n])
            actuators.append(
                ActuatorState(
                    facts.name, position, target, _word(state), homing or self._under_way,
                    bool(state["homed"][n]),
                )
            )  # fmt: skip
        moving = self._moves(state)
        return ControllerState(tuple(actuators), moving, bool(state["on"]), {})

    def _moves(self, state: Answer) -> bool:
        self._under_way = bool(state["on"]) and not (state["in_position"] and state["idle"])
        return self._under_way or any(state["homing"])

    async def _added(self) -> list[float]:
        """What genhexkins adds to each length for the turn of its screw, mm."""
        pins = [f"genhexkins.correction.{n}" for n in range(len(self._actuators))]
        values = (await self._ask("get", pins=pins))["values"]
        return [values[pin] for pin in pins]

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
            raise self._refused("does not switch on", "Look at its own screen")
        self._watch.expect(on=True)

    async def disable(self) -> None:
        """Stop what moves, and machine off."""
        self._watch.expect(on=False)
        self._targets = None
        await self._ask("off", POWER_S)

    async def clear_faults(self) -> None:
        """Leave emergency stop if what holds it lets go; raises the fault that stays."""
        self._watch.expect(on=False)
        await self._ask("reset", POWER_S)
        await self._ask("off", POWER_S)
        if (await self._ask("state"))["estop"]:
            raise self._watch.in_estop()
        self._watch.clear()

    def _refused(self, what: str, remedy: str) -> Refused:
        said, self._link.said = "; ".join(self._link.said), []
        return Refused(f"{what} ({said})" if said else what, device=self._device, remedy=remedy)

    # ------------------------------------------------------------ motion

    async def home(self, actuator: str) -> None:
        """Let one joint find its home switch; raises Refused, DriveFault, DeviceFault."""
        names = [facts.name for facts in self._actuators]
        if actuator not in names:
            raise Refused(
                f"there is no actuator {actuator!r}",
                device=self._device,
                remedy=f"Name one of {', '.join(names)}.",
            )
        joint = names.index(actuator)
        self._targets = None
        self._link.said = []
        stops = self._stops
        await self._ask("home", joint=joint)
        deadline = asyncio.get_running_loop().time() + self._settings["home_s"]
        began = False
        while True:
            state = await self._checked(stops)
            began = began or bool(state["homing"][joint])
            if state["homed"][joint] and not state["homing"][joint]:
                await self._check_pose(state)
                return
            if self._link.said or (began and not state["homing"][joint]):
                said, self._link.said = "; ".join(self._link.said), []
                raise DriveFault(
                    f"joint {joint} did not find its home ({said or 'no reason given'})",
                    device=self._device,
                    remedy="Check the home switch and HOME_... of this joint in the INI file",
                )
            if asyncio.get_running_loop().time() > deadline:
                await self.stop()
                raise DeviceFault(
                    f"joint {joint} is not home after {self._settings['home_s']:g} s",
                    device=self._device,
                    remedy="Check its home switch",
                )
            await asyncio.sleep(POLL_S)

    async def _check_pose(self, state: Answer) -> None:
        """When all joints are homed, genhexkins must have found the pose from them."""
        if not all(state["homed"]):
            return
        degrees = map(math.radians, state["pose"][3:])
        lengths = self._places.lengths(await self._pins(), state["pose"][:3], matrix(*degrees))
        joints = [a - b for a, b in zip(state["joints"], await self._added(), strict=True)]
        if not all(abs(a - b) < FOUND_MM for a, b in zip(lengths, joints, strict=True)):
            await self.disable()
            raise DeviceFault(
                "genhexkins finds no pose for the joints where they are homed",
                device=self._device,
                remedy="Home must lie near X0 Y0 Z0 A0 B0 C0, from where it is looked for: put the "
                "offset into the z of the base joints",
            )

    async def move_to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """Command a pose and start moving; returns the lengths of the struts there.

        They are worked out from the pins that genhexkins uses; :meth:`wait_arrived` compares them
        with where LinuxCNC has sent the joints. Raises Refused, or the fault that stands.
        """
        self.check()
        if len(pose) != 6 or not all(map(math.isfinite, pose)):
            raise self._refused(f"{pose} is no pose", "Give x, y, z in mm and three angles in rad")
        state = await self._ask("state")
        if not state["on"] or not all(state["homed"]):
            what = "is off" if not state["on"] else "is not homed"
            raise self._refused(what, "Switch it on and home all joints first")
        targets = self._places.lengths(await self._pins(), pose[:3], matrix(*pose[3:]))
        self._check_limits(targets)
        self._link.said = []
        self._under_way = True
        accepted = (await self._ask("mdi", POWER_S, line=self._block(pose)))["accepted"]
        if not accepted or self._link.said:
            await self._ask("abort")
            self._under_way = False
            self._watch.look(await self._ask("state"))
            self.check()
            raise self._refused("refuses the pose", "Check the limits in the INI file")
        self._targets = targets
        return targets

    def _block(self, pose: tuple[float, ...]) -> str:
        """One straight way to a pose in machine coordinates, without tool or work offsets."""
        speed = self._settings["speed_mm_s"]
        words = [*pose[:3], *map(math.degrees, pose[3:])]
        places = " ".join(f"{w}{v:.15f}" for w, v in zip("XYZABC", words, strict=True))
        return f"G21 G90 G94 G53 {f'G1 F{60.0 * speed:.3f}' if speed else 'G0'} {places}"

    def _check_limits(self, targets: tuple[float, ...]) -> None:
        for facts, target in zip(self._actuators, targets, strict=True):
            low, high = facts.limits
            if not low <= target <= high:
                raise self._refused(
                    f"{facts.name} would be {target:.3f} mm, allowed are {low:g} to {high:g}",
                    "Choose another pose",
                )

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until LinuxCNC stands at the pose; ``timeout`` in wall seconds.

        Raises DeviceFault if the motion was stopped, if it did not end, or if the joints were sent
        elsewhere than the pins say; LinkLost if LinuxCNC is gone.
        """
        stops = self._stops
        deadline = asyncio.get_running_loop().time() + timeout
        while True:
            state = await self._checked(stops)
            if not self._moves(state):
                break
            if asyncio.get_running_loop().time() > deadline:
                raise DeviceFault(
                    f"has not arrived after {timeout:g} s",
                    device=self._device,
                    remedy="Look what holds it: feed override, feed hold, its own screen",
                )
            await asyncio.sleep(POLL_S)
        if self._link.said:
            said, self._link.said = "; ".join(self._link.said), []
            raise DeviceFault(f"stopped on the way: {said}", device=self._device)
        if self._targets is not None:
            await self._compare(state)

    async def _compare(self, state: Answer) -> None:
        """LinuxCNC must have sent the joints where its own pins say that the pose is."""
        assert self._targets is not None
        added = await self._added()
        sent = [state["commanded"][n] - added[n] for n in range(len(added))]
        off = [abs(a - b) for a, b in zip(sent, self._targets, strict=True)]
        if not max(off) < AGREES_MM:
            n = off.index(max(off))
            raise DeviceFault(
                f"joint {n} was sent {max(off):.6f} mm beside the strut's length at this pose",
                device=self._device,
                remedy="Something else moves the machine, or it has changed pins meanwhile",
            )

    async def _checked(self, stops: int) -> Answer:
        """The state, unless a fault stands or the motion was stopped."""
        self.check()
        if self._stops != stops:
            raise DeviceFault("the motion was stopped", device=self._device)
        state = await self._ask("state")
        self._watch.look(state)
        self.check()
        return state

    async def stop(self) -> None:
        """Stop all motion, at any moment; never raises for a second call."""
        self._stops += 1
        self._targets = None
        await self._ask("abort")

    # ------------------------------------------------------------ parameters

    async def read_parameters(self) -> dict[str, float]:
        """Read every parameter from the pins, bit for bit."""
        return self._places.parameters(await self._pins())

    async def write_parameters(self, values: Mapping[str, float]) -> None:
        """Set the pins, read them back bit for bit, and forget the joints' references.

        The machine must be off: genhexkins uses new pins at once, and the motors would step. L0 is
        the joint's place at its home switch, so every joint is to be homed again. Raises Refused
        (with the name of the parameter) or ParameterError.
        """
        chosen = {name: float(value) for name, value in values.items()}
        before = await self._pins()
        held = self._places.parameters(before)
        for name, value in chosen.items():
            if name not in held or not math.isfinite(value):
                what = f"cannot hold {name} = {value}" if name in held else f"has no {name}"
                raise self._refused(what, "Nothing was written")
        if (await self._ask("state"))["on"]:
            raise self._refused("is on", "Switch the machine off before parameters are written")
        await self._load(self._places.to_pins({**held, **chosen}, before), before)

    async def _load(self, pins: Mapping[str, float], before: Mapping[str, float]) -> None:
        """Set what differs; raises ParameterError if a pin does not take it."""
        changed = {name: value for name, value in pins.items() if before[name] != value}
        if not changed:
            return
        found = (await self._ask("set", pins=changed))["values"]
        different = [name for name, value in changed.items() if found[name] != value]
        if different:
            raise ParameterError(
                f"{different[0]} is {found[different[0]]!r}, {changed[different[0]]!r} was set",
                device=self._device,
                remedy="A pin that a signal drives cannot be set; take it out of the HAL file",
            )
        await self._ask("unhome", POWER_S)
        if any((await self._ask("state"))["homed"]):
            raise ParameterError(
                "keeps the references of its joints, which are no longer true",
                device=self._device,
                remedy="Home all joints again before anything moves",
            )

    async def parameter_checksum(self) -> int:
        """CRC-32 over the parameters as the pins have them."""
        values = await self.read_parameters()
        text = "\n".join(f"{name} {value!r}" for name, value in sorted(values.items()))
        return zlib.crc32(text.encode())

    async def store_parameters(self) -> None:
        """Write the pins into the HAL file and the INI file; the old files stay beside them."""
        pins = await self._pins()
        await asyncio.to_thread(self._stored.write, pins)

    async def reload_parameters(self) -> None:
        """Start LinuxCNC again, or read what is stored and set the pins to it."""
        if (await self._ask("state"))["on"]:
            raise self._refused("is on", "Switch the machine off first")
        if self._settings["restart"]:
            await self._restart()
            return
        before = await self._pins()
        await self._load(self._stored.pins(before), before)

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
