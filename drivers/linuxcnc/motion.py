"""Motion of LinuxCNC: joints to their home switches, the platform to poses by G-code."""

import asyncio
import math

from drivers.errors import DeviceFault, DriveFault, Refused
from drivers.kind import Surroundings
from drivers.linuxcnc.link import ITS_SCREEN, Answer, Ask
from drivers.linuxcnc.parameter_access import POWER_S, ParameterAccess
from drivers.linuxcnc.places import Places
from drivers.linuxcnc.rotation import matrix
from drivers.linuxcnc.watch import Watch

AGREES_MM = 1e-6
"""How far LinuxCNC's joints may end from the lengths that its own pins give."""
STAYS_S = 1.0
"""For how long, at rest, they may be farther: while what is added to them is on its way."""
FOUND_MM = 1e-3
"""How far the pose that it found may be from its joints."""
POLL_S = 0.02


class Motion:
    """What moves, and where to.

    ``targets`` are the lengths at the last pose that was commanded; None where there is none.
    ``said`` collects the errors that LinuxCNC reports.
    """

    def __init__(
        self,
        ask: Ask,
        around: Surroundings,
        places: Places,
        parameters: ParameterAccess,
        watch: Watch,
        said: list[str],
        device: str,
    ) -> None:
        self.targets: tuple[float, ...] | None = None
        self.under_way = False
        self._ask, self._places, self._parameters, self._watch = ask, places, parameters, watch
        self._settings, self._actuators = around.settings, around.actuators
        self._said, self._device = said, device
        self._stops = 0

    def check(self) -> None:
        """Raise the fault that stands."""
        self._watch.check()

    def moves(self, state: Answer) -> bool:
        """Whether the platform or a joint is under way."""
        self.under_way = bool(state["on"]) and not (state["in_position"] and state["idle"])
        return self.under_way or any(state["homing"])

    async def added(self) -> list[float]:
        """What genhexkins adds to each length for the turn of its screw, mm."""
        pins = [f"genhexkins.correction.{n}" for n in range(len(self._actuators))]
        values = (await self._ask("get", pins=pins))["values"]
        return [values[pin] for pin in pins]

    def refused(self, what: str, remedy: str) -> Refused:
        """What is said of a no, with LinuxCNC's own words."""
        said = "; ".join(self._said)
        self._said.clear()
        return Refused(f"{what} ({said})" if said else what, device=self._device, remedy=remedy)

    async def home(self, actuator: str) -> None:
        """Let one joint find its home switch; raises Refused, DriveFault, DeviceFault."""
        names = [facts.name for facts in self._actuators]
        if actuator not in names:
            raise self.refused(f"there is no actuator {actuator!r}", f"Name one of {names}")
        joint = names.index(actuator)
        self.targets = None
        self._said.clear()
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
            if self._said or (began and not state["homing"][joint]):
                said = "; ".join(self._said)
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
        lengths = self._places.lengths(
            await self._parameters.pins(), state["pose"][:3], matrix(*degrees)
        )
        joints = [a - b for a, b in zip(state["joints"], await self.added(), strict=True)]
        if not all(abs(a - b) < FOUND_MM for a, b in zip(lengths, joints, strict=True)):
            await self.stop()
            await self._ask("off", POWER_S)
            self._watch.expect(on=False)
            raise DeviceFault(
                "genhexkins finds no pose for the joints where they are homed",
                device=self._device,
                remedy="Home must lie near X0 Y0 Z0 A0 B0 C0, from where it is looked for: put the "
                "offset into the z of the base joints",
            )

    async def to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """Command a pose and start moving; returns the lengths of the struts there.

        They are worked out from the pins that genhexkins uses; :meth:`arrived` compares them
        with where LinuxCNC has sent the joints. Raises Refused, or the fault that stands.
        """
        self.check()
        if len(pose) != 6 or not all(map(math.isfinite, pose)):
            raise self.refused(f"{pose} is no pose", "Give x, y, z in mm and three angles in rad")
        state = await self._ask("state")
        if not state["on"] or not all(state["homed"]):
            what = "is off" if not state["on"] else "is not homed"
            raise self.refused(what, "Switch it on and home all joints first")
        targets = self._places.lengths(await self._parameters.pins(), pose[:3], matrix(*pose[3:]))
        self._check_limits(targets)
        self._said.clear()
        self.under_way = True
        accepted = (await self._ask("mdi", POWER_S, line=self._block(pose)))["accepted"]
        if not accepted or self._said:
            await self._ask("abort")
            self.under_way = False
            self._watch.look(await self._ask("state"))
            self.check()
            raise self.refused("refuses the pose", "Check the limits in the INI file")
        self.targets = targets
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
                raise self.refused(
                    f"{facts.name} would be {target:.3f} mm, allowed are {low:g} to {high:g}",
                    "Choose another pose",
                )

    async def arrived(self, timeout: float) -> None:
        """Wait until LinuxCNC stands at the pose; ``timeout`` in wall seconds.

        Raises DeviceFault if the motion was stopped, if it did not end, or if the joints were sent
        elsewhere than the pins say; LinkLost if LinuxCNC is gone.
        """
        stops = self._stops
        deadline = asyncio.get_running_loop().time() + timeout
        while True:
            state = await self._checked(stops)
            if not self.moves(state):
                break
            if asyncio.get_running_loop().time() > deadline:
                raise DeviceFault(
                    f"has not arrived after {timeout:g} s",
                    device=self._device,
                    remedy="Look what holds it: feed override, feed hold, its own screen",
                )
            await asyncio.sleep(POLL_S)
        if self._said:
            said = "; ".join(self._said)
            raise DeviceFault(f"stopped on the way: {said}", device=self._device, remedy=ITS_SCREEN)
        await self._compare(stops, state)

    async def _compare(self, stops: int, state: Answer) -> None:
        """LinuxCNC must have sent the joints where its own pins say that the pose is.

        What it adds for backlash and screws is read after where it sent them, and may still be on
        its way: a difference counts once it stays.
        """
        deadline = asyncio.get_running_loop().time() + STAYS_S
        while self.targets is not None:
            added = await self.added()
            sent = [state["commanded"][n] - added[n] for n in range(len(added))]
            off = [abs(a - b) for a, b in zip(sent, self.targets, strict=True)]
            if max(off) < AGREES_MM:
                return
            if asyncio.get_running_loop().time() > deadline:
                n = off.index(max(off))
                raise DeviceFault(
                    f"joint {n} was sent {max(off):.6f} mm beside the strut's length at this pose",
                    device=self._device,
                    remedy="Something else moves the machine, or it has changed pins meanwhile",
                )
            await asyncio.sleep(POLL_S)
            state = await self._checked(stops)

    async def _checked(self, stops: int) -> Answer:
        """The state, unless a fault stands or the motion was stopped."""
        self.check()
        if self._stops != stops:
            raise DeviceFault(
                "the motion was stopped",
                device=self._device,
                remedy="Enable the machine and command the pose again.",
            )
        state = await self._ask("state")
        self._watch.look(state)
        self.check()
        return state

    async def stop(self) -> None:
        """Stop all motion, at any moment; never raises for a second call."""
        self._stops += 1
        self.targets = None
        await self._ask("abort")
