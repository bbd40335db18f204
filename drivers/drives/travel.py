"""A common motion under way: watched until every drive has arrived, or all are stopped."""

import asyncio
from collections.abc import Sequence

from drivers.canopen.drive402 import (
    ACKNOWLEDGED,
    ACTUAL_POSITION,
    ERROR_CODE,
    LIMITED,
    REACHED,
    STATUSWORD,
    Drive402,
    drive_fault,
    state_name,
)
from drivers.drives.axis import Axis
from drivers.drives.bus import DriveBus
from drivers.drives.cyclic import Stream
from drivers.drives.follower import Follower
from drivers.drives.sync import must_take_setpoints
from drivers.errors import DeviceError, DeviceFault, DriveFault, LinkError, Refused, Silence

POLL_S = 0.01
AWAY = 4
"""A drive that is so many windows behind its start runs the wrong way."""


class Travel:
    """One motion from ``starts`` to ``targets`` (counts); it watches itself from the beginning.

    ``straight``: every drive goes straight from its start to its target. One that was under way,
    or plays a trajectory, may first go elsewhere.
    """

    def __init__(
        self,
        bus: DriveBus,
        stream: Stream | None,
        starts: Sequence[int],
        targets: Sequence[int],
        straight: bool = True,
    ) -> None:
        self._straight = straight
        self._bus = bus
        self._stream = stream
        self._followers = [Follower(axis, bus) for axis in bus.axes]
        self._starts = tuple(starts)
        self._targets = tuple(targets)
        self._task = asyncio.ensure_future(self._watch())
        # Who stops the machine need not wait for the end of its motion.
        self._task.add_done_callback(lambda task: task.cancelled() or task.exception())

    @property
    def over(self) -> bool:
        """Whether it has ended, at its target or otherwise."""
        return self._task.done()

    def cancel(self) -> None:
        """Watch no longer: another motion takes its place."""
        self._task.cancel()

    async def wait(self, timeout: float) -> None:
        """Wait for its end, at most ``timeout`` wall seconds; raises what ended it."""
        done, _ = await asyncio.wait([self._task], timeout=timeout)
        if not done:
            raise Silence(
                f"the motion did not end within {timeout:g} s",
                device="drives",
                remedy="Stop the machine and look at the actuators.",
            )
        if self._task.cancelled():
            raise DeviceFault(
                "another motion took the place of this one",
                device="drives",
                remedy="Wait for the last one.",
            )
        self._task.result()

    async def _watch(self) -> None:
        try:
            while not await self._arrived():  # noqa: ASYNC110 - a drive's word, not an event
                await asyncio.sleep(POLL_S)
        except DeviceError as error:
            if not isinstance(error, LinkError):
                await self._bus.send_stop()
            raise

    async def _arrived(self) -> bool:
        self._bus.link.check()
        held = self._stream.held if self._stream is not None else ()
        each = zip(self._bus.drives, self._bus.axes, self._starts, self._targets, strict=True)
        looks = await asyncio.gather(*(self._look(*one) for one in each))
        if self._stream is not None:
            for follower, (_, counts), setpoint in zip(self._followers, looks, held, strict=True):
                follower.look(counts, setpoint)
        over = self._stream is None or self._stream.over
        return all(there for there, _ in looks) and over

    async def _look(self, drive: Drive402, axis: Axis, start: int, target: int) -> tuple[bool, int]:
        word, counts = await drive.remote.call(
            lambda: (drive.read_now(STATUSWORD), drive.read_now(ACTUAL_POSITION))
        )
        state = state_name(word)
        if state.startswith("fault"):
            code = await drive.read(ERROR_CODE)
            self._bus.latch_drive(drive.remote.id, code)
            raise drive_fault(drive.device, code)
        if state != "operation enabled":
            raise DeviceFault(
                f"the motion was stopped before it reached its target (state {state!r})",
                device=drive.device,
                remedy="Enable the machine and command the motion again.",
            )
        if self._stream is not None and not word & ACKNOWLEDGED:  # there: it follows set-points
            await must_take_setpoints(drive)
        if self._straight:
            self._must_not_run_away(drive, axis, start, target, counts)
        near = abs(counts - target) <= self._bus.window(axis)
        if self._stream is None and word & REACHED and word & LIMITED and not near:
            raise Refused(
                "the target is outside the drive's software limits (0x607D)",
                device=drive.device,
                remedy="The actuator stands at its limit; command a position inside.",
            )
        return near and (self._stream is not None or bool(word & REACHED)), counts

    def _must_not_run_away(
        self, drive: Drive402, axis: Axis, start: int, target: int, counts: int
    ) -> None:
        """A motor that is wired the wrong way round moves away from its target from the start."""
        forward = 1 if target >= start else -1
        behind = (start - counts) * forward
        if behind > AWAY * self._bus.window(axis) and abs(counts - target) > abs(start - target):
            raise DriveFault(
                f"moves away from its target ({behind / abs(axis.scale):.3g} {axis.unit} the wrong "
                "way)",
                device=drive.device,
                remedy="Check the wiring of motor and encoder, and polarity (0x607E).",
            )
