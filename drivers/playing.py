"""Devices that can run through rows of actuator values: what makes them a trajectory's."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable


@runtime_checkable
class PlaysRows(Protocol):
    """Motors that take set-points at a rate."""

    @property
    def accelerations(self) -> tuple[float, ...]:
        """Largest acceleration of each actuator, mm/s^2 or rad/s^2."""

    async def play_actuators(self, rows: Sequence[Sequence[float]], every_s: float) -> None:
        """Start along ``rows`` (N, A) of actuator coordinates, one each ``every_s`` seconds.

        Raises Refused, before anything moves, if it does not begin where the machine is held,
        passes limits, speed or acceleration, or if another motion is under way.
        """
