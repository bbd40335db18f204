"""What the motions of every GCS controller share: a stop forbids starts, every wait has an end."""

import asyncio
import math
import time
from collections.abc import Callable
from typing import TypeVar

from drivers.errors import DeviceFault, Refused, Silence
from drivers.gcs.errors import NOT_ENABLED
from drivers.gcs.line import ANSWER_S, Line
from drivers.gcs.link import GcsLink
from drivers.stopping import STILL_MOVING

T = TypeVar("T")
REST_S, STOP_S = 1.5, 2.5


class Moving:
    """Motions that are begun by one command and over when the controller says so.

    Parameters
    ----------
    link : GcsLink
    poll_s : float
        Between two questions whether a motion is over.
    parts : str
        What moves, as a remedy names it: "legs".
    """

    def __init__(self, link: GcsLink, poll_s: float, parts: str) -> None:
        self._link = link
        self._device = link.device
        self._poll_s = poll_s
        self._parts = parts
        self._stopped = False

    def look(self, line: Line, timeout: float) -> None:
        """Latch what went wrong by itself: servos off, a restart."""
        raise NotImplementedError

    def switched_on(self, stops: int) -> None:
        """Motion is allowed again, unless a stop has come since ``stops`` was read."""
        self._stopped = stops != self._link.line.stops

    def check_numbers(self, values: tuple[float, ...], count: int, what: str) -> None:
        """Refuse a wrong number of values, NaN and infinity."""
        if len(values) != count or not all(map(math.isfinite, values)):
            raise Refused(
                f"{what} has {count} finite numbers, this is {values}",
                device=self._device,
                remedy="Nothing was commanded.",
            )

    async def _started(self, start: Callable[[Line, int], T]) -> T:
        """Send what starts a motion, with the stops counted so far, unless a stop comes first."""
        self._link.check()
        stops = self._link.line.stops
        if self._stopped:
            raise Refused(
                "the machine was stopped", device=self._device, remedy="Enable the machine first."
            )
        try:
            return await self._link.call(lambda line: start(line, stops))
        except Refused as error:
            if error.code == NOT_ENABLED:
                await self._look_for_cause()
            raise

    async def _look_for_cause(self) -> None:
        """Raise a servo's fault or a restart, if that is why the machine does not move."""
        await self._link.call(lambda line: self.look(line, ANSWER_S))
        self._link.check()

    async def _next_look(self, deadline: float, timeout: float) -> None:
        """Wait before the next question; raises Silence after ``deadline``."""
        if time.monotonic() > deadline:
            raise Silence(
                f"the motion did not end within {timeout} s",
                device=self._device,
                remedy=f"Stop the machine and look at the {self._parts}.",
            )
        await asyncio.sleep(self._poll_s)

    async def _interrupted(self) -> DeviceFault:
        await self._look_for_cause()
        return DeviceFault(
            "the motion was stopped before it reached its target",
            device=self._device,
            remedy="Enable the machine and command the pose again.",
        )

    async def _rest(self) -> None:
        """Wait until nothing moves after a stop; raises Silence."""
        deadline = time.monotonic() + REST_S
        while await self._link.call(lambda line: line.moving()):
            if time.monotonic() > deadline:
                raise Silence(
                    "the machine is still moving", device=self._device, remedy=STILL_MOVING
                )
            await asyncio.sleep(self._poll_s)
