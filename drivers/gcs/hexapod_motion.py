"""The motions of a closed hexapod: one target of six numbers, all axes together.

Status comes from #5 (does it move), ``ONT?``, ``SVO?`` and ``FRF?``: such a controller has no
status register.
"""

import time
from collections.abc import Callable, Sequence

from drivers.errors import DeviceFault, DriveFault, Refused
from drivers.gcs.answers import numbers
from drivers.gcs.errors import STARTING, UNKNOWN_COMMAND
from drivers.gcs.line import ANSWER_S, Line
from drivers.gcs.link import GcsLink
from drivers.gcs.moving import STOP_S, Moving
from drivers.stopping import STILL_MOVING, confirmed, within

REFERENCE_S = 120.0
Written = tuple[float, ...]
"""X, Y, Z, U, V, W in the controller's own units."""


class HexapodMotion(Moving):
    """Starts, waits for and stops the motions of one controller."""

    def __init__(self, link: GcsLink, axes: Sequence[str]) -> None:
        super().__init__(link, 0.01, "legs")
        self._axes = tuple(axes)
        self._limits: tuple[Written, Written] = ((), ())
        self._asks_first = True
        self._target: Written = ()
        self._powered = False
        self._known = False

    # ------------------------------------------------------------ asking

    def _ask(self, line: Line, what: str, timeout: float = ANSWER_S) -> Written:
        return numbers(
            line.query(f"{what} {' '.join(self._axes)}", timeout), self._axes, self._device
        )

    def read_limits(self, line: Line) -> None:
        """Ask for the travel limits of every axis; blocking."""
        self._limits = self._ask(line, "TMN?"), self._ask(line, "TMX?")

    def look(self, line: Line, timeout: float) -> None:
        """Latch servos that went off by themselves, and a restart; called between two jobs."""
        powered, known = self._powered, self._known
        if not powered:
            return
        try:
            servo = all(self._ask(line, "SVO?", timeout))
        except Refused as error:
            if error.code == STARTING:
                self._link.latch("restart", _restarted(self._device))
                return
            raise
        if servo or not self._powered:
            return
        if known and not all(self._ask(line, "FRF?", timeout)):
            self._link.latch("restart", _restarted(self._device))
        else:
            self._link.latch("drive", _servo_off(self._device))

    async def target(self) -> Written:
        """What it says it is bound for."""
        return await self._link.call(lambda line: self._ask(line, "MOV?"))

    # ------------------------------------------------------------ power

    async def enable(self) -> None:
        """Switch all servos on; raises Refused, DriveFault."""
        self._link.check()
        stops = self._link.line.stops

        def switch(line: Line) -> tuple[bool, bool]:
            line.command(self._switch(True), stops=stops)
            return all(self._ask(line, "SVO?")), all(self._ask(line, "FRF?"))

        on, known = await self._link.call(switch)
        if not on:
            raise Refused(
                "does not switch its servos on",
                device=self._device,
                remedy="Check the emergency stop, the enable inputs and the motors' supply",
            )
        self._powered, self._known = True, known
        self.switched_on(stops)

    async def disable(self) -> None:
        """Switch all servos off."""
        self._powered = False
        await self._link.call(lambda line: line.command(self._switch(False)))

    def _switch(self, on: bool) -> str:
        return "SVO " + " ".join(f"{axis} {int(on)}" for axis in self._axes)

    # ------------------------------------------------------------ starting

    async def to(self, target: Written, first: Callable[[Line], None]) -> None:
        """Start towards a target, after ``first`` and after asking whether it is reachable."""
        command = " ".join(
            f"{axis} {value!r}" for axis, value in zip(self._axes, target, strict=True)
        )
        self._need_within(target)

        def start(line: Line, stops: int) -> Written:
            first(line)
            self._need_reachable(line, command)
            line.command(f"MOV {command}", stops=stops)
            return self._ask(line, "MOV?")

        self._target = await self._started(start)

    def _need_within(self, target: Written) -> None:
        for axis, value, low, high in zip(self._axes, target, *self._limits, strict=True):
            if not low <= value <= high:
                raise Refused(
                    f"axis {axis} = {value:.5g} is outside the controller's limits, {low:g} to "
                    f"{high:g}",
                    device=self._device,
                    remedy="Choose a pose within them",
                )

    def _need_reachable(self, line: Line, command: str) -> None:
        """Ask (VMO?) whether the legs allow it; a controller that cannot say is asked once."""
        if not self._asks_first:
            return
        try:
            answer = line.bare(f"VMO? {command}")
        except Refused as error:
            if error.code != UNKNOWN_COMMAND:
                raise
            self._asks_first = False
            return
        if answer != "1":
            raise Refused(
                f"says that it cannot go to {command} (VMO?)",
                device=self._device,
                remedy="Choose a pose nearer to its middle",
            )

    async def reference(self) -> None:
        """Run the reference move; raises Refused, DriveFault, DeviceFault, Silence."""
        await self._started(lambda line, stops: line.command(f"FRF {self._axes[0]}", stops=stops))
        self._known = False
        await self.ready(REFERENCE_S)
        if not all(await self._link.call(lambda line: self._ask(line, "FRF?"))):
            raise DeviceFault(
                "was stopped before it found its reference",
                device=self._device,
                remedy="Enable the machine and home it again.",
            )
        self._known = True

    # ------------------------------------------------------------ waiting

    async def ready(self, timeout: float) -> None:
        """Wait until it rests and takes commands: it starts up, or looks for its reference."""
        deadline = time.monotonic() + timeout
        while not await self._link.call(lambda line: line.ready() and not line.moving()):
            self._link.check()
            await self._next_look(deadline, timeout)
        self._link.check()

    async def arrived(self, timeout: float) -> None:
        """Wait until it rests on its target; raises as wait_arrived."""
        deadline = time.monotonic() + timeout
        while True:
            servo, rests = await self._link.call(self._rests)
            self._link.check()
            if not servo:
                raise await self._interrupted()
            if rests:
                break
            await self._next_look(deadline, timeout)
        # A controller that was stopped is on target, too: where it stands.
        if await self.target() != self._target:
            raise await self._interrupted()

    def _rests(self, line: Line) -> tuple[bool, bool]:
        servo = all(self._ask(line, "SVO?"))
        return servo, not line.moving() and all(self._ask(line, "ONT?"))

    # ------------------------------------------------------------ stopping

    async def stop(self) -> None:
        """Send #24 and wait for rest; never raises for a second call."""
        again, self._stopped = self._stopped, True
        async with confirmed(again, STILL_MOVING), within(STOP_S, self._device):
            await self._link.stop()
            await self._rest()


def _servo_off(device: str) -> DriveFault:
    return DriveFault(
        "its servos switched themselves off (following error, emergency stop or hardware)",
        device=device,
        remedy="Remove the cause, clear the faults and enable the machine again.",
    )


def _restarted(device: str) -> DeviceFault:
    return DeviceFault(
        "was switched off and on: it has lost its reference, and what was not stored",
        device=device,
        remedy="Clear the faults, enable the machine again and home it.",
    )
