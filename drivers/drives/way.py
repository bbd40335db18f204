"""Ways of set-points: where all drives shall be some machine seconds after a way was begun."""

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.drives.axis import Axis
from drivers.drives.profile import Profile

Counts = tuple[int, ...]


def _between(starts: Counts, ends: Counts, part: float) -> Counts:
    return tuple(round(a + part * (b - a)) for a, b in zip(starts, ends, strict=True))


@dataclass(frozen=True)
class Straight:
    """Straight in actuator space, with a trapezoidal ramp."""

    starts: Counts
    ends: Counts
    profile: Profile

    @classmethod
    def of(cls, axes: Sequence[Axis], starts: Counts, ends: Counts) -> "Straight":
        """The fastest that no axis forbids."""
        each = zip(axes, starts, ends, strict=True)
        return cls(starts, ends, Profile.of(axes, [(b - a) / axis.scale for axis, a, b in each]))

    @property
    def duration(self) -> float:
        """Machine seconds that it takes."""
        return self.profile.duration

    def at(self, time: float) -> Counts:
        """Set-points ``time`` machine seconds after its begin."""
        return _between(self.starts, self.ends, self.profile.at(time))

    def braked(self, time: float) -> "Slowing":
        """Brake as the profile would at its end: it stays on the way."""
        rate = self.profile.rate_at(time)
        if not rate:
            return Slowing(self.at(time), self.at(time), 0.0)
        part = self.profile.at(time) + 0.5 * rate**2 / self.profile.acceleration
        end = _between(self.starts, self.ends, min(part, 1.0))
        return Slowing(self.at(time), end, rate / self.profile.acceleration)


@dataclass(frozen=True)
class Slowing:
    """The last piece of a way, braked evenly to rest."""

    starts: Counts
    ends: Counts
    duration: float

    def at(self, time: float) -> Counts:
        """Set-points ``time`` machine seconds after its begin."""
        left = 1.0 - min(time / self.duration, 1.0) if self.duration else 0.0
        return _between(self.starts, self.ends, 1.0 - left**2)

    def braked(self, time: float) -> "Slowing":
        """What is left of it."""
        left = max(self.duration - time, 0.0)
        return Slowing(self.at(time), self.ends, left)


@dataclass(frozen=True)
class Table:
    """A trajectory: rows of set-points, ``every_s`` apart, straight between them."""

    rows: tuple[Counts, ...]
    every_s: float

    @property
    def duration(self) -> float:
        """Machine seconds that it takes."""
        return self.every_s * (len(self.rows) - 1)

    def at(self, time: float) -> Counts:
        """Set-points ``time`` machine seconds after its begin."""
        place = min(max(time / self.every_s, 0.0), len(self.rows) - 1.0)
        row = min(int(place), len(self.rows) - 2)
        if row < 0:
            return self.rows[0]
        return _between(self.rows[row], self.rows[row + 1], place - row)


Way = Straight | Slowing | Table
