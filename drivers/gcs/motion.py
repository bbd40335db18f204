"""Starting motions, waiting for their end, and stopping them."""

import asyncio
import math
import time
from collections.abc import Mapping

from drivers.errors import DeviceFault, Refused, Silence
from drivers.gcs.answers import numbers
from drivers.gcs.axes import MOVING, ON_TARGET, REFERENCING, SERVO, Axes
from drivers.gcs.errors import NOT_ENABLED
from drivers.gcs.line import ANSWER_S, Line
from drivers.gcs.link import GcsLink
from drivers.gcs.watch import Watch
from drivers.stopping import BY_ITSELF, STILL_MOVING, confirmed, within

REST_S, STOP_S, POLL_S = 1.5, 2.5, 0.005
# What a solver may leave of an angle that is meant to be 0.
LEVEL_RAD = 1e-6


class Motion:
    """The motions of one controller."""

    def __init__(self, link: GcsLink, axes: Axes, watch: Watch) -> None:
        self.targets: tuple[float, ...] = ()
        self._link = link
        self._axes = axes
        self._watch = watch
        self._device = link.device
        self._stopped = False

    # ------------------------------------------------------------ starting

    def switched_on(self, stops: int) -> None:
        """Motion is allowed again, unless a stop has come since ``stops`` was read."""
        self._stopped = stops != self._link.line.stops

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
        """Send what starts a motion, unless a stop comes first."""
        self._link.check()
        stops = self._link.line.stops
        if self._stopped:
            raise Refused(
                "the machine was stopped", device=self._device, remedy="Enable the machine first."
            )
        try:
            await self._link.call(lambda line: line.command(command, stops=stops))
        except Refused as error:
            if error.code == NOT_ENABLED:
                await self._look_for_cause()
            raise

    async def _look_for_cause(self) -> None:
        """Raise a servo's fault or a restart, if that is why the machine does not move."""
        await self._link.call(lambda line: self._watch.look(line, ANSWER_S))
        self._link.check()

    def _read_targets(self, line: Line) -> tuple[float, ...]:
        axes = self._axes
        return numbers(line.query(f"MOV? {axes.words}"), axes.driven, self._device)

    def check_numbers(self, values: tuple[float, ...], count: int, what: str) -> None:
        """Refuse a wrong number of values, NaN and infinity."""
        if len(values) != count or not all(map(math.isfinite, values)):
            raise Refused(
                f"{what} needs {count} finite numbers, got {values}",
                device=self._device,
                remedy="Nothing was commanded.",
            )

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
            self._need_time(deadline, timeout)
            await asyncio.sleep(POLL_S)
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
            self._need_time(deadline, timeout)
            await asyncio.sleep(POLL_S)
        self._link.check()
        known = await self._link.call(lambda line: line.query(f"FRF? {axis}"))
        if not numbers(known, [axis], self._device)[0]:
            raise DeviceFault(
                f"axis {axis} was stopped before it found its reference",
                device=self._device,
                remedy="Enable the machine and home it again.",
            )

    async def _interrupted(self) -> DeviceFault:
        await self._look_for_cause()
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

    # ------------------------------------------------------------ stopping

    async def stop(self, switch_off: str) -> None:
        """Send #24, wait for rest and send ``switch_off``; never raises for a second call."""
        again, self._stopped = self._stopped, True
        async with confirmed(again, BY_ITSELF), within(STOP_S, self._device):
            await self._link.stop()
            await self._rest()
            await self._link.call(lambda line: line.command(switch_off))

    async def _rest(self) -> None:
        deadline = time.monotonic() + REST_S
        while await self._link.call(lambda line: line.moving()):
            if time.monotonic() > deadline:
                raise Silence(
                    "the machine is still moving", device=self._device, remedy=STILL_MOVING
                )
            await asyncio.sleep(POLL_S)
