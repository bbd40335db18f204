"""How many counts a drive has in one mm or rad, by its own objects. Blocking calls.

0x60A8 (SI unit of the position) says it at once where a drive counts in metres, radians or
degrees. A drive that counts increments says by 0x608F (increments a revolution of the motor),
0x6091 (revolutions of the motor for one of the shaft) and 0x6092 (feed a revolution of the shaft)
how far one of them goes, in a unit that the standard leaves open: mostly a power of ten of mm or
rad, which the site file may name.
"""

import math
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Told:
    """Counts in one unit of q as a drive has them, and by which objects.

    ``open``: only up to a power of ten.
    """

    counts: float
    how: str
    open: bool = False

    def agrees(self, counts: float) -> bool:
        """Whether a site file's number can be the same."""
        ratio = self.counts / counts
        if self.open:
            ratio /= 10.0 ** round(math.log10(ratio))
        return abs(ratio - 1.0) < AGREES


def told_counts(drive: Drive402, axis: Axis, feed_unit: float) -> Told | None:
    """What the drive says of its counts; ``feed_unit`` 0 where nobody knows. None if nothing."""
    try:
        code = int.from_bytes(drive.remote.upload(SI_UNIT), "little")
    except SdoAbortedError:
        code = 0
    si = _si_counts(code, axis.unit)
    if si is not None:
        return Told(si, f"0x60A8 = 0x{code:08X}")
    ratios = [_ratio(drive, index) for index in (RESOLUTION, GEAR, FEED)]
    if ratios[0] is None or ratios[2] is None:
        return None
    resolution, gear, feed = (1.0 if ratio is None else ratio for ratio in ratios)
    counts = resolution * gear / (feed * (feed_unit or 1.0))
    return Told(counts, "0x608F, 0x6091 and 0x6092", open=not feed_unit)


def counts_of(drive: Drive402, axis: Axis, feed_unit: float, believe: bool) -> float:
    """Return the counts in one unit of q; raises Refused if site file and drive disagree."""
    told = told_counts(drive, axis, feed_unit) if believe else None
    if axis.counts is None:
        if told is None or told.open:
            raise Refused(
                f"does not say how many counts it has in one {axis.unit}",
                device=drive.device,
                remedy="Write counts_per_unit under [controller], or what 0x6092 counts in as "
                "feed_unit.",
            )
        return told.counts
    if told is not None and not told.agrees(axis.counts):
        raise Refused(
            f"has {told.counts:.8g} counts in one {axis.unit} by {told.how}"
            f"{' (or that times a power of ten)' if told.open else ''}, the site file says "
            f"counts_per_unit = {axis.counts:.8g}",
            device=drive.device,
            remedy="Correct the one that is wrong; if these objects mean nothing in this drive, "
            'write factors = "ignore".',
        )
    return axis.counts
