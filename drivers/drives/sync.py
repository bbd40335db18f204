"""What a drive must be told before it takes set-points by RPDO at SYNC; all by SDO."""

import struct

from drivers.canopen.drive402 import (
    CYCLIC_POSITION,
    MODE_DISPLAY,
    TARGET_POSITION,
    Drive402,
)
from drivers.drives.axis import Axis
from drivers.drives.profile import PROFILE_VELOCITY, Profile
from drivers.errors import DeviceFault, Refused

SYNC = (0x80, b"")
SYNC_COB_ID, INTERPOLATION = 0x1005, 0x60C2
COB_ID_BITS = 0x7FF
INVALID = 1 << 31
COMMUNICATION, MAPPING, BASE = 0x1401, 0x1601, 0x300


def setpoint_frame(drive: Drive402, counts: int) -> tuple[int, bytes]:
    """The frame (COB-ID, data) of a set-point."""
    return BASE + drive.remote.id, struct.pack("<i", counts)


async def take_setpoints(drive: Drive402, axis: Axis, period_s: float) -> None:
    """Map 0x607A alone into RPDO 2, taken at each SYNC, and set 0x60C2; raises Refused.

    0x6081 is set to the axis's speed: some drives bound set-points by it, and what stands there may
    be the crawl of a short way in mode profile. 0x60C2 is not in every drive: those without it take
    the period from SYNC itself. 0x1006 stays as the drive holds it: one that watches SYNC by it may
    fault when a busy PC is late once.
    """
    if drive.has(SYNC_COB_ID):
        held = await drive.read(SYNC_COB_ID) & COB_ID_BITS
        if held != SYNC[0]:
            raise Refused(
                f"listens for SYNC at COB-ID 0x{held:X} (0x1005), it is sent at 0x{SYNC[0]:X}",
                device=drive.device,
                remedy='Set 0x1005 of this drive to 0x80, or use mode = "profile".',
            )
    await _map_setpoint(drive)
    await drive.write(PROFILE_VELOCITY, Profile.of([axis], [0.0]).speed_of(axis, 0.0))
    if drive.has(INTERPOLATION, 1):
        await drive.write(INTERPOLATION, round(period_s * 1000.0), 1)
        await drive.write(INTERPOLATION, -3, 2)


async def _map_setpoint(drive: Drive402) -> None:
    device = drive.remote
    cob_id = BASE + device.id

    def write() -> None:
        steps = (
            (COMMUNICATION, 1, struct.pack("<I", cob_id | INVALID)),
            (MAPPING, 0, b"\0"),
            (MAPPING, 1, struct.pack("<I", TARGET_POSITION << 16 | 32)),
            (MAPPING, 0, b"\1"),
            (COMMUNICATION, 2, b"\1"),
            (COMMUNICATION, 1, struct.pack("<I", cob_id)),
        )
        for index, sub, data in steps:
            device.download(index, sub, data)

    try:
        await device.call(write)
    except Refused as error:
        raise Refused(
            f"does not let its RPDO 2 be mapped: {error.what}",
            device=drive.device,
            remedy='Use mode = "profile".',
            code=error.code,
        ) from error


async def must_take_setpoints(drive: Drive402) -> None:
    """Raise DeviceFault if the drive has left the mode in which it follows set-points."""
    mode = await drive.read(MODE_DISPLAY)
    if mode != CYCLIC_POSITION:
        raise DeviceFault(
            f"has left mode {CYCLIC_POSITION}: it is in mode {mode} (0x6061) and follows no "
            "set-points",
            device=drive.device,
            remedy="See whether another program or a panel commands it; then enable again.",
        )
