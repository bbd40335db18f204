"""A common motion in mode profile: each drive makes its own ramp, and all make the same."""

import asyncio
from collections.abc import Callable, Sequence

from drivers.canopen.drive402 import AT_ONCE, ENABLE, NEW_SETPOINT, TARGET_POSITION, Drive402
from drivers.drives.axis import Axis
from drivers.drives.bus import DriveBus
from drivers.drives.profile import (
    PROFILE_ACCELERATION,
    PROFILE_DECELERATION,
    PROFILE_VELOCITY,
    Profile,
)


async def start_profiles(
    bus: DriveBus, counts: Sequence[int], starts: Sequence[int], go_on: Callable[[], None]
) -> None:
    """Write what each drive shall do, then start all of them with one frame each.

    ``go_on`` raises if the machine was stopped meanwhile.
    """
    drives, axes = bus.drives, bus.axes
    ways = [(b - a) / axis.scale for a, b, axis in zip(starts, counts, axes, strict=True)]
    profile = Profile.of(axes, ways)

    async def prepare(drive: Drive402, axis: Axis, target: int, way: float) -> None:
        acceleration = profile.acceleration_of(axis, way)
        await drive.write(TARGET_POSITION, target)
        await drive.write(PROFILE_VELOCITY, profile.speed_of(axis, way))
        await drive.write(PROFILE_ACCELERATION, acceleration)
        if drive.has(PROFILE_DECELERATION):
            await drive.write(PROFILE_DECELERATION, acceleration)

    each = zip(drives, axes, counts, ways, strict=True)
    await asyncio.gather(*(prepare(*one) for one in each))
    go_on()
    await bus.send_controlword(ENABLE | NEW_SETPOINT | AT_ONCE)
    await asyncio.gather(*(drive.acknowledge(True) for drive in drives))
    go_on()
    await bus.send_controlword(ENABLE)
