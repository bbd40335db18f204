"""A stop that could not be confirmed says so once, whatever stood in its way."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TypeVar

from drivers.errors import DeviceError, Silence

ErrorT = TypeVar("ErrorT", bound=DeviceError)
STILL_MOVING = "Use the emergency stop."
BY_ITSELF = "Use the emergency stop. Without the PC the machine stops by itself."


@asynccontextmanager
async def confirmed(again: bool, remedy: str = BY_ITSELF) -> AsyncIterator[None]:
    """Around what sends a stop and waits for rest.

    Raises the DeviceError that came, in the words of a stop; nothing where the stop is asked for
    ``again``: then it is known.
    """
    try:
        yield
    except DeviceError as error:
        if not again:
            raise type(error)(
                f"the stop was not confirmed ({error.what})", device=error.device, remedy=remedy
            ) from error


@asynccontextmanager
async def within(seconds: float, device: str) -> AsyncIterator[None]:
    """Around what must be over before a deadline; raises Silence where it is not."""
    try:
        async with asyncio.timeout(seconds):
            yield
    except TimeoutError as error:
        raise Silence(
            f"no answer within {seconds:g} s", device=device, remedy=STILL_MOVING
        ) from error


def stopped(kind: type[ErrorT], device: str) -> ErrorT:
    """What a reading ends with that the operator stops."""
    return kind("stopped by the operator", device=device, remedy="Measure again to go on.")
