"""An actuator and its drive: actuator coordinates to counts and back."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Axis:
    """What the site file says of one drive; ``None`` where it leaves it to the drive.

    q = offset + sign x counts of the drive / counts per unit.

    Attributes
    ----------
    counts : float or None
        Of its position in one mm or rad, positive; None until the drive was asked.
    sign : float
        +1, or -1 if the drive counts down as q grows.
    offset : float
        q at the drive's zero.
    limits : tuple
        Lowest and highest q.
    speed, acceleration : float
        Largest, in units a second (squared).
    speed_counts, acceleration_counts : float or None
        Of 0x6081 and 0x6083 in one unit a second (squared); None where they are those of the
        position.
    """

    name: str
    unit: str
    node: int
    eds: Path
    counts: float | None
    sign: float
    offset: float
    homing_method: int | None
    limits: tuple[float, float]
    speed: float
    acceleration: float
    speed_counts: float | None = None
    acceleration_counts: float | None = None

    @property
    def scale(self) -> float:
        """Counts in one unit of q, with the sign."""
        assert self.counts is not None  # asked at connect
        return self.sign * self.counts

    def to_counts(self, q: float) -> int:
        """Return the drive's position at ``q``."""
        return round((q - self.offset) * self.scale)

    def to_q(self, counts: int) -> float:
        """Return the actuator coordinate at a position of the drive."""
        return self.offset + counts / self.scale

    def limits_in_counts(self) -> tuple[int, int]:
        """The limits as the drive counts, lowest first."""
        low, high = sorted(map(self.to_counts, self.limits))
        return low, high
