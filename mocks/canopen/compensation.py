"""What the controller does between the extension that it wants and the one its drive makes.

The values are *errors of the screw*, as identified: a drive that makes the extension d gives
d + g d + T(d) - sign * b / 2, where g is the pitch error, T the cyclic table and b the lost
motion after the last change of the commanded extension (sign 0 before the first). The controller
solves that for d.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

PASSES = 6


@dataclass(frozen=True)
class Compensation:
    """One actuator's values: pitch (ratio), backlash, cyclic period and table (its units).

    Table point k of N stands at the extension k * period / N; between points the error is linear,
    and it repeats with the period. A period of 0 switches the table off.
    """

    pitch: float
    backlash: float
    period: float
    table: Sequence[float]

    def cyclic(self, extension: float) -> float:
        """Return T at ``extension``."""
        if self.period <= 0.0:
            return 0.0
        count = len(self.table)
        place = math.fmod(extension / self.period, 1.0) % 1.0 * count
        low = int(place) % count
        share = place - int(place)
        return (1.0 - share) * self.table[low] + share * self.table[(low + 1) % count]

    def error(self, drive: float, direction: int) -> float:
        """Return what the screw adds to the drive's extension ``drive``."""
        return self.pitch * drive + self.cyclic(drive) - 0.5 * self.backlash * direction

    def drive_for(self, wanted: float, direction: int) -> float:
        """Return the drive's extension that gives the extension ``wanted``."""
        drive = wanted
        for _ in range(PASSES):
            drive = wanted - self.error(drive, direction)
        return drive

    def wanted_for(self, drive: float, direction: int) -> float:
        """Return the extension that the drive's extension ``drive`` stands for."""
        return drive + self.error(drive, direction)


def direction_of(change: float, before: int, smallest: float) -> int:
    """Return the sign of the last change of the commanded extension larger than ``smallest``."""
    if abs(change) <= smallest:
        return before
    return 1 if change > 0.0 else -1
