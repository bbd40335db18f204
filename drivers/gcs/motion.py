"""Starting motions, waiting for their end, and stopping them."""

import time
from collections.abc import Mapping

from drivers.errors import DeviceFault, Refused
from drivers.gcs.answers import numbers
from drivers.gcs.axes import MOVING, ON_TARGET, REFERENCING, SERVO, Axes
from drivers.gcs.line import Line
from drivers.gcs.link import GcsLink
from drivers.gcs.moving import STOP_S, Moving
from drivers.gcs.watch import Watch
from drivers.stopping import BY_ITSELF, confirmed, within

# What a solver may leave of an angle that is meant to be 0.
LEVEL_RAD = 1e-6


class Motion(Moving):
    """The motions of one controller."""

    def __init__(self, link: GcsLink, axes: Axes, watch: Watch) -> None:
        super().__init__(link, 0.005, "actuators")
        self.targets: tuple[float, ...] = ()
        self._axes = axes
        self._watch = watch

    def look(self, line: Line, timeout: float) -> None:
        """Latch what went wrong by itself."""
        self._watch.look(line, timeout)

    # ------------------------------------------------------------ starting

    async def to_position(self, pose: tuple[float, ...]) -> None:
        """Start towards a pose of the platform; raises Refused."""
        count = len(self._axes.pose)
        if self._axes.turns is not None:
            self.check_numbers(pose, count, "pose")
            pose = self._axes.turns.written(pose)
        position, turn = pose[:count], pose[count:]
        self.check_numbers(position, count, "pose")
        if any(abs(angle) > LEVEL_RAD for angle in turn):
            raise Refused(
                f"the platform cannot turn, the pose asks for {turn}",
                device=self._device,
                remedy="Command poses with rx = ry = rz = 0.",
            )
        await self.to(dict(zip(self._axes.pose, position, strict=True)))

    async def to(self, targets: Mapping[str, float]) -> None:
        """Start towards targets by axis, and learn those of all actuators."""
        words = " ".join(f"{axis} {float(value)!r}" for axis, value in targets.items())
        await self._start(f"MOV {words}")
        self.targets = await self._link.call(self._read_targets)

    async def _start(self, command: str) -> None:
        await self._started(lambda line, stops: line.command(command, stops=stops))

    def _read_targets(self, line: Line) -> tuple[float, ...]:
        axes = self._axes
        return numbers(line.query(f"MOV? {axes.words}"), axes.driven, self._device)

    # ------------------------------------------------------------ waiting

    async def arrived(self, timeout: float) -> None:
        """Wait until every drive reports its target reached; raises as wait_arrived."""
        deadline = time.monotonic() + timeout
        while True:
            bits = await self._watch.registers()
            self._link.check()
            if not all(word & SERVO for word in bits):
                raise await self._interrupted()
            if all(word & ON_TARGET and not word & MOVING for word in bits):
                break
            await self._next_look(deadline, timeout)
        # A controller that was stopped is on target, too: where it stands.
        if await self._link.call(self._read_targets) != self.targets:
            raise await self._interrupted()

    async def reference(self, axis: str, timeout: float) -> None:
        """Run a reference move; raises Refused, DriveFault, DeviceFault, Silence."""
        await self._start(f"FRF {axis}")
        n = self._axes.driven.index(axis)
        deadline = time.monotonic() + timeout
        while (await self._watch.registers())[n] & REFERENCING:
            self._link.check()
            await self._next_look(deadline, timeout)
        self._link.check()
        known = await self._link.call(lambda line: line.query(f"FRF? {axis}"))
        if not numbers(known, [axis], self._device)[0]:
            raise DeviceFault(
                f"axis {axis} was stopped before it found its reference",
                device=self._device,
                remedy="Enable the machine and home it again.",
            )

    # ------------------------------------------------------------ stopping

    async def stop(self, switch_off: str) -> None:
        """Send #24, wait for rest and send ``switch_off``; never raises for a second call."""
        again, self._stopped = self._stopped, True
        async with confirmed(again, BY_ITSELF), within(STOP_S, self._device):
            await self._link.stop()
            await self._rest()
            await self._link.call(lambda line: line.command(switch_off))
