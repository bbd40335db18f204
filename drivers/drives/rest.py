"""Waiting until all drives of a machine are off and stand."""

import asyncio
import time
from collections.abc import Awaitable, Callable

from drivers.drives.bus import DriveBus
from drivers.errors import Silence
from drivers.interface import ControllerState
from drivers.stopping import STILL_MOVING

REST_DEADLINE_S = 3.0
POLL_S = 0.01


async def at_rest(bus: DriveBus, state: Callable[[], Awaitable[ControllerState]]) -> None:
    """Wait until no drive has power and none moves; tell again one that still has it.

    Raises Silence at the deadline.
    """
    deadline = time.monotonic() + REST_DEADLINE_S
    before: list[float] = []
    while True:
        actuators = (await state()).actuators
        now = [actuator.position for actuator in actuators]
        on = [a for a in actuators if a.state == "operation enabled"]
        still = len(before) == len(now) and all(
            abs(one - two) <= 2.0 / abs(axis.scale)
            for one, two, axis in zip(before, now, bus.axes, strict=True)
        )
        if still and not on:
            return
        if time.monotonic() > deadline:
            raise Silence(
                "the machine is still moving, or has power", device="drives", remedy=STILL_MOVING
            )
        if on:
            await bus.send_stop()
        before = now
        await asyncio.sleep(POLL_S)
