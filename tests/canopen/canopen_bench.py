"""What the tests of the CANopen driver share beside the station itself."""

import asyncio
import struct
from collections.abc import Callable

from drivers.canopen import CanopenController
from drivers.interface import ControllerState

FAST_MM_PER_S = 20.0


async def set_speed(controller: CanopenController, mm_per_s: float) -> None:
    """Let the legs move this fast."""
    device = controller._bus.controller
    await device.call(lambda: device.download(0x2430, 0, struct.pack("<d", mm_per_s)))


async def until(true: Callable[[], bool], timeout: float = 20.0) -> None:
    """Wait for a condition."""
    async with asyncio.timeout(timeout):
        while not true():  # noqa: ASYNC110 - a plain value, not an event
            await asyncio.sleep(0.01)


async def until_state(
    controller: CanopenController, true: Callable[[ControllerState], bool]
) -> ControllerState:
    """Wait until the controller's state is as wanted, and return it."""
    async with asyncio.timeout(20.0):
        while not true(state := await controller.state()):  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    return state
