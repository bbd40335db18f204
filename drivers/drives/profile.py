"""Speeds of a common motion: every axis makes the same profile, each over its own way.

With way w_i, largest speed v_i and acceleration a_i, all axes run s(t) from 0 to 1 with
ds/dt <= min v_i/w_i and d2s/dt2 <= min a_i/w_i. Axis i is then given the speed w_i ds/dt and the
acceleration w_i d2s/dt2: whatever the form of the drives' ramps, as long as it is the same in
all, they start and end together and the way is straight in actuator space.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

from drivers.drives.axis import Axis

PROFILE_VELOCITY, PROFILE_ACCELERATION, PROFILE_DECELERATION = 0x6081, 0x6083, 0x6084


@dataclass(frozen=True)
class Profile:
    """Largest ds/dt (1/s) and d2s/dt2 (1/s^2) of a common motion."""

    rate: float
    acceleration: float

    @classmethod
    def of(cls, axes: Sequence[Axis], ways: Sequence[float]) -> "Profile":
        """The fastest that no axis forbids; ``ways`` in units of q, of either sign."""
        pairs = [(axis, abs(way)) for axis, way in zip(axes, ways, strict=True) if way]
        return cls(
            min((axis.speed / way for axis, way in pairs), default=inf),
            min((axis.acceleration / way for axis, way in pairs), default=inf),
        )

    @property
    def duration(self) -> float:
        """Seconds that a trapezoidal ramp takes."""
        if self.rate == inf:
            return 0.0
        if self.rate**2 >= self.acceleration:
            return 2.0 / sqrt(self.acceleration)
        return 1.0 / self.rate + self.rate / self.acceleration

    def at(self, time: float) -> float:
        """Part s of the way that is behind after ``time`` s, on a trapezoidal ramp."""
        end = self.duration
        if time <= 0.0 or time >= end:
            return float(time > 0.0 or not end)
        if time > 0.5 * end:
            return 1.0 - self.at(end - time)
        ramp = min(self.rate / self.acceleration, 0.5 * end)
        begun = min(time, ramp)
        return 0.5 * self.acceleration * begun**2 + self.acceleration * ramp * (time - begun)

    def rate_at(self, time: float) -> float:
        """ds/dt, 1/s, after ``time`` s on that ramp."""
        left = self.duration - time
        if time <= 0.0 or left <= 0.0:
            return 0.0
        return min(self.rate, self.acceleration * min(time, left))

    def speed_of(self, axis: Axis, way: float) -> int:
        """0x6081 of an axis: at least 1, because some drives take 0 for never."""
        speed = min(abs(way) * self.rate, axis.speed) if way else axis.speed
        return max(round(speed * (axis.speed_counts or axis.counts or 0.0)), 1)

    def acceleration_of(self, axis: Axis, way: float) -> int:
        """0x6083 and 0x6084 of an axis."""
        largest = axis.acceleration
        acceleration = min(abs(way) * self.acceleration, largest) if way else largest
        return max(round(acceleration * (axis.acceleration_counts or axis.counts or 0.0)), 1)
