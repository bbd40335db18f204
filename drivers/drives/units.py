"""How many counts a drive has in one mm or rad, by its own objects. Blocking calls.

0x60A8 (SI unit of the position) says it at once where a drive counts in metres, radians or
degrees. A drive that counts increments says by 0x608F (increments a revolution of the motor),
0x6091 (revolutions of the motor for one of the shaft) and 0x6092 (feed a revolution of the shaft)
how far one of them goes.
"""

import math

from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen.drive402 import Drive402
from drivers.drives.axis import Axis
from drivers.errors import Refused

SI_UNIT, RESOLUTION, GEAR, FEED = 0x60A8, 0x608F, 0x6091, 0x6092
METRE, RADIAN, DEGREE = 0x01, 0x10, 0x41
AGREES = 1e-5


def _ratio(drive: Drive402, index: int) -> float | None:
    """First entry by the second; None where the drive has none."""
    try:
        above, below = (int.from_bytes(drive.remote.upload(index, sub), "little") for sub in (1, 2))
    except SdoAbortedError:
        return None
    return above / below if above and below else None


def _si_counts(code: int, unit: str) -> float | None:
    """Counts in one mm or rad by 0x60A8: power of ten, unit, denominator, reserved."""
    power = code >> 24 & 0xFF
    scale = 10.0 ** (power - 256 if power > 127 else power)
    of = {(METRE, "mm"): 1e-3, (RADIAN, "rad"): 1.0, (DEGREE, "rad"): 180.0 / math.pi}
    one = of.get((code >> 16 & 0xFF, unit))
    return None if one is None or code >> 8 & 0xFF else one / scale


def told_counts(drive: Drive402, axis: Axis, feed_unit: float) -> tuple[float, str] | None:
    """Counts in one unit of q as the drive has them, and by which objects; None if by none."""
    try:
        code = int.from_bytes(drive.remote.upload(SI_UNIT), "little")
    except SdoAbortedError:
        code = 0
    si = _si_counts(code, axis.unit)
    if si is not None:
        return si, f"0x60A8 = 0x{code:08X}"
    ratios = [_ratio(drive, index) for index in (RESOLUTION, GEAR, FEED)]
    if not feed_unit or ratios[0] is None or ratios[2] is None:
        return None
    resolution, gear, feed = (1.0 if ratio is None else ratio for ratio in ratios)
    return resolution * gear / (feed * feed_unit), "0x608F, 0x6091 and 0x6092"


def counts_of(drive: Drive402, axis: Axis, feed_unit: float) -> float:
    """Return the counts in one unit of q; raises Refused if site file and drive disagree."""
    told = told_counts(drive, axis, feed_unit)
    if told is None:
        if axis.counts is None:
            raise Refused(
                f"does not say how many counts it has in one {axis.unit}",
                device=drive.device,
                remedy="Write counts_per_unit in the site file.",
            )
        return axis.counts
    value, how = told
    if axis.counts is not None and abs(value / axis.counts - 1.0) > AGREES:
        raise Refused(
            f"has {value:.8g} counts in one {axis.unit} by {how}, the site file says "
            f"counts_per_unit = {axis.counts:.8g}",
            device=drive.device,
            remedy="Correct the one that is wrong; if 0x6092 counts in another unit, write it as "
            "feed_unit (0: do not look at it).",
        )
    return axis.counts or value
