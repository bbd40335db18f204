"""Where a machine was measured, and how far outside a wanted pose lies.

A range for each task coordinate, each actuator and each channel: a hull of poses in six
dimensions would leave out nearly all of what lies between them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array
from calib.identify import Fit
from calib.mechanism.description import Machine
from calib.mechanism.task import task_values

Range = tuple[float, float]
SHARE = 0.1
"""Part of a range by which one may go beyond it and still count as inside."""
TEMPERATURE_K = 1.0
"""The same of temperatures, whatever their range."""


@dataclass(frozen=True)
class Excess:
    """One quantity beyond the range in which it was measured, in ``unit``."""

    pose: int
    name: str
    value: float
    low: float
    high: float
    unit: str

    @property
    def beyond(self) -> float:
        """How far beyond the nearer end of the range."""
        return max(self.low - self.value, self.value - self.high)

    def __str__(self) -> str:
        degrees = self.unit == "rad"
        scale = 180.0 / np.pi if degrees else 1.0
        unit = "deg" if degrees else self.unit
        low, high, beyond = (scale * v for v in (self.low, self.high, self.beyond))
        return (
            f"{self.name} is {beyond:.4g} {unit} beyond what was measured "
            f"({low:.6g} to {high:.6g} {unit})"
        )


@dataclass(frozen=True)
class Region:
    """Ranges in which a model was measured.

    Attributes
    ----------
    poses : int
        Number of poses that were measured.
    task, actuators, channels : mapping of str to (low, high)
        By task coordinate, by actuator (q, mm or rad) and by column name.
    """

    poses: int
    task: Mapping[str, Range] = field(default_factory=dict)
    actuators: Mapping[str, Range] = field(default_factory=dict)
    channels: Mapping[str, Range] = field(default_factory=dict)

    @classmethod
    def of_fit(cls, fit: Fit) -> "Region":
        """Where the accepted readings of a fit were taken."""
        rows, situation = fit.model.rows, fit.linear.situation
        machine, used = rows.machine, fit.accepted & rows.on_platform
        values = task_values(machine.task, situation.closed.poses)[:, situation.state_of]
        return cls(
            poses=len({tuple(q) for q in np.round(rows.q[:, used].T, 6)}),
            task=_ranges(machine.task.coordinates, values[:, used]),
            actuators=_ranges([a.name for a in machine.actuators], rows.q[:, used]),
            channels={
                name: (float(known.min()), float(known.max()))
                for name, column in rows.channels.items()
                if (known := column[used & np.isfinite(column)]).size
            },
        )

    def walls(self, machine: Machine) -> "Walls":
        """The same prepared for many poses of a machine."""
        free = (-np.inf, np.inf)
        return Walls(
            _Ends.of(
                [
                    (name, self.task.get(name, free), "mm" if name in "xyz" else "rad")
                    for name in machine.task.coordinates
                ]
                + [(a.name, self.actuators.get(a.name, free), a.unit) for a in machine.actuators]
            ),
            {
                name: _Ends.of([(name, ends, _unit_of(name))])
                for name, ends in self.channels.items()
            },
        )


@dataclass(frozen=True, eq=False)
class _Ends:
    """Ranges of m quantities by name, range and unit; (m, 1) where they count as left."""

    ranges: Sequence[tuple[str, Range, str]]
    low: Array
    high: Array

    @classmethod
    def of(cls, ranges: Sequence[tuple[str, Range, str]]) -> "_Ends":
        """With what may be passed of them."""
        spare = np.array([_spare(name, *ends) for name, ends, _ in ranges])
        low, high = np.array([ends for _, ends, _ in ranges]).T
        return cls(ranges, (low - spare)[:, None], (high + spare)[:, None])

    def passed(self, values: Array) -> list[Excess]:
        """What of values (m, N) is beyond."""
        beyond = (values < self.low) | (values > self.high)
        if not beyond.any():
            return []
        return [
            Excess(int(pose), name, float(values[k, pose]), *ends, unit)
            for k, (name, ends, unit) in enumerate(self.ranges)
            for pose in np.flatnonzero(beyond[k])
        ]


@dataclass(frozen=True, eq=False)
class Walls:
    """The ends of all ranges: of task coordinates and actuators, and of channels by name."""

    machine: _Ends
    channels: Mapping[str, _Ends]

    def outside(self, task: Array, q: Array, channels: Mapping[str, Array]) -> list[Excess]:
        """What lies outside, pose by pose.

        Parameters
        ----------
        task, q : (k, N), (n, N)
            Wanted task coordinates and commanded actuator coordinates, mm or rad; nan is passed
            over.
        channels : mapping of str to (N,)
        """
        found = self.machine.passed(np.concatenate([task, q]))
        for name, values in channels.items():
            if name in self.channels:
                found += self.channels[name].passed(np.reshape(values, (1, -1)))
        return sorted(found, key=lambda one: one.pose)


def _ranges(names: Sequence[str], values: Array) -> dict[str, Range]:
    return {
        name: (float(row.min()), float(row.max()))
        for name, row in zip(names, values, strict=True)
        if row.size
    }


def _spare(name: str, low: float, high: float) -> float:
    least = TEMPERATURE_K if name.endswith("_C") else 1e-9
    return max(SHARE * (high - low), least)


def _unit_of(channel: str) -> str:
    for ending, unit in (("_C", "K"), ("_kg", "kg"), ("_s", "s"), ("_mm", "mm"), ("_N", "N")):
        if channel.endswith(ending):
            return unit
    return ""
