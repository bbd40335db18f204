"""Commands to the controller and its status, as PDOs.

A command is a sequence number and a code (RPDO 1), for a pose preceded by one REAL64 each in
RPDO 2...; the controller answers with TPDO 2... (targets q) and then TPDO 1, its status, which
repeats the sequence number and comes again whenever it changes. What does not come as a PDO in
time is asked for once by SDO, so that a lost frame costs time and nothing else.
"""

import asyncio
import math
import struct
import time
from collections.abc import Callable, Sequence

from drivers.canopen import layout as at
from drivers.canopen.device import Device
from drivers.canopen.layout import Layout
from drivers.canopen.motion_status import INTERRUPTED, MotionStatus
from drivers.errors import DeviceFault, Silence

ANSWER_DEADLINE_S = 1.0
POLL_S = 0.5
REAL64 = struct.Struct("<d")
MOVE_TO_POSE, MOVE_TO_Q, STOP, PREPARE = 1, 2, 3, 0x10


class MotionChannel:
    """The motion objects of one controller node."""

    def __init__(self, controller: Device, layout: Layout) -> None:
        self.status = MotionStatus(0, 0, 0, 0)
        self._controller = controller
        self._link = link = controller.link
        self._layout = layout
        self._device = controller.label
        self._targets = [math.nan] * len(layout.actuators)
        self._sequence = 0
        self._lock = asyncio.Lock()
        self._waiters: list[asyncio.Future[None]] = []
        self._command_id, *self._pose_ids = [pdo.cob_id for pdo in controller.node.rpdo.values()]
        status, *targets = list(controller.node.tpdo.values())
        status.add_callback(
            lambda pdo: link.in_loop(self._on_status, MotionStatus.from_bytes(bytes(pdo.data)))
        )
        for n, target in enumerate(targets):
            target.add_callback(
                lambda pdo, n=n: link.in_loop(self._on_target, n, *REAL64.unpack(pdo.data))
            )

    def _on_target(self, n: int, q: float) -> None:
        self._targets[n] = q

    def _on_status(self, status: MotionStatus) -> None:
        self.status = status
        self.wake()

    def wake(self) -> None:
        """Let everyone who waits look again (a status or a fault has come)."""
        waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            if not waiter.done():
                waiter.set_result(None)

    async def _change(self, timeout: float) -> None:
        """Wait until something has come, at most ``timeout`` wall seconds."""
        waiter = asyncio.get_running_loop().create_future()
        self._waiters.append(waiter)
        await asyncio.wait([waiter], timeout=max(timeout, 0.0))

    async def until(self, reached: Callable[[MotionStatus], bool], timeout: float) -> bool:
        """Wait until ``reached`` a status; False if it does not come before ``timeout``.

        Raises the standing fault of the link or of a drive.
        """
        deadline = time.monotonic() + timeout
        while not reached(self.status):
            self._link.check()
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            before = self.status
            await self._change(min(left, POLL_S))
            if self.status is before and not reached(before):
                await self.refresh()
        return True

    async def refresh(self) -> MotionStatus:
        """Read the status by SDO."""

        def read() -> MotionStatus:
            parts = [self._controller.upload(at.STATUS, sub) for sub in (1, 2, 3, 4)]
            return MotionStatus.from_bytes(b"".join(parts))

        self.status = await self._controller.call(read)
        return self.status

    async def synchronise(self) -> None:
        """Take over the controller's sequence number; once, after connecting."""
        self._sequence = (await self.refresh()).sequence

    def command_frame(self, code: int) -> tuple[int, bytes]:
        """Return the frame of a new command (COB-ID, data)."""
        self._sequence = self._sequence % 0xFFFF + 1
        return self._command_id, struct.pack("<HB", self._sequence, code)

    async def command(self, code: int, pose: Sequence[float] = ()) -> None:
        """Send a command and wait for its answer; raises Refused, Silence or a standing fault."""
        async with self._lock:
            frames = [
                (cob_id, struct.pack("<d", value))
                for cob_id, value in zip(self._pose_ids, pose, strict=False)
            ]
            self._targets = [math.nan] * len(self._targets)
            command = self.command_frame(code)
            sequence = self._sequence
            await self._link.send([*frames, command])
            # A stop may overtake: an answer to a later command answers this one too.
            if not await self.until(lambda s: s.answers(sequence), ANSWER_DEADLINE_S):
                raise Silence(
                    f"no answer to a motion command within {ANSWER_DEADLINE_S} s",
                    device=self._device,
                    remedy="Stop the machine; check that the controller is OPERATIONAL.",
                )
            refusal = self.status.refusal(self._device, self._layout.actuators)
            if refusal is not None:
                raise refusal

    async def targets(self) -> tuple[float, ...]:
        """Return the targets q of the last motion, from the TPDOs if they have come."""
        if not all(map(math.isfinite, self._targets)):
            self._targets = await self.read_array(at.TARGET_Q)
        return tuple(self._targets)

    async def read_array(self, index: int) -> list[float]:
        """Read an array of one REAL64 an actuator."""
        subs = range(1, len(self._layout.actuators) + 1)

        def read() -> list[float]:
            data = b"".join(self._controller.upload(index, sub) for sub in subs)
            return list(struct.unpack(f"<{len(subs)}d", data))

        return await self._controller.call(read)

    async def wait_arrived(self, timeout: float) -> None:
        """Wait for the end of the motion at its target; raises DeviceFault, Silence."""
        over = await self.until(lambda s: s.arrived or bool(s.bits & INTERRUPTED), timeout)
        self._link.check()
        if not over:
            raise Silence(
                f"the motion did not end within {timeout} s",
                device=self._device,
                remedy="Stop the machine and look at the actuators.",
            )
        if not self.status.arrived:
            raise DeviceFault(
                "the motion was stopped before it reached its target",
                device=self._device,
                remedy="Enable the machine and command the pose again.",
            )
