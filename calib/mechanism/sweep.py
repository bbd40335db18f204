"""Walking along the chains of limbs: where their ends are, and the screws of what is passed.

Arrays are component first, pose last; twists are scaled: [v / size; omega].
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Numbers, Selection
from calib.mechanism.compiled import Group, element_value
from calib.mechanism.configuration import Configuration
from calib.mechanism.rigid import cross


@dataclass(eq=False)
class Standing:
    """Where the machine is during a solution; changed in place by the solver.

    ``position`` (3, N), ``rotation`` (3, 3, N), ``passive`` (n_joints, N) and, for each group of
    limbs, ``strain`` (n_compliant, L, N).
    """

    position: Numbers
    rotation: Numbers
    passive: Numbers
    strain: list[Numbers]

    @classmethod
    def of(cls, closed: Configuration) -> "Standing":
        """Where a closed machine stands."""
        poses = closed.poses
        return cls(poses.position, poses.rotation, closed.passive, list(closed.strain))

    def take(self, which: Selection) -> "Standing":
        """Poses selected by index, slice or mask."""
        return Standing(
            self.position[:, which],
            self.rotation[:, :, which],
            self.passive[:, which],
            [strain[:, :, which] for strain in self.strain],
        )


@dataclass(frozen=True, eq=False)
class Screw:
    """Axis of an element in the base frame: direction (3, L, N) and a point on it, or None."""

    direction: Numbers
    point: Numbers | None

    def twist(self, origin: Numbers, size: float, out: Numbers) -> None:
        """Write the scaled twist at ``origin`` (3, 1, N) into ``out`` (6, L, N)."""
        if self.point is None:
            np.divide(self.direction, size, out=out[:3])
            out[3:] = 0.0
        else:
            moment = cross(self.direction, origin - self.point)
            np.divide(moment, size, out=out[:3])
            out[3:] = self.direction

    def velocity(self, at: "Screw") -> Numbers:
        """Velocity (3, L, N) of the points of the axis ``at`` per unit of this joint."""
        if self.point is None or at.point is None:
            return self.direction
        return cross(self.direction, at.point - self.point)


def _turn(columns: list[Numbers], axis: int, angle: Numbers) -> list[Numbers]:
    k, l = (axis + 1) % 3, (axis + 2) % 3  # noqa: E741 - k, l follow the axis cyclically
    c, s = np.cos(angle), np.sin(angle)
    turned = list(columns)
    turned[k] = columns[k] * c + columns[l] * s
    turned[l] = columns[l] * c - columns[k] * s
    return turned


def _quarter_turns(columns: list[Numbers], axis: int, count: int) -> list[Numbers]:
    k, l = (axis + 1) % 3, (axis + 2) % 3  # noqa: E741 - k, l follow the axis cyclically
    turned = list(columns)
    for _ in range(count):
        turned[k], turned[l] = turned[l], -turned[k]
    return turned


def sweep(
    group: Group, parameters: Numbers, extension: Numbers, state: Standing, strain: Numbers
) -> tuple[Numbers, Numbers, tuple[Screw, ...]]:
    """Walk along the chains of a group: end position (3, L, N), rotation (3, 3, L, N), screws."""
    columns = [np.eye(3)[j].reshape(3, 1, 1) for j in range(3)]
    point: Numbers = np.zeros((3, 1, 1))
    screws: list[Screw] = []
    for k, element in enumerate(group.elements):
        screws.append(Screw(columns[element.axis], point if element.turns else None))
        if element.compliance is not None:
            value: Numbers | None = strain[group.compliant.index(k)]
        else:
            value = element_value(element, parameters, extension, state.passive)
        if value is None or (value.shape[-1] == 1 and not np.any(value)):
            continue
        if element.quarters is not None:
            columns = _quarter_turns(columns, element.axis, element.quarters)
        elif element.turns:
            columns = _turn(columns, element.axis, value)
        else:
            point = point + columns[element.axis] * value
    shape = np.broadcast_shapes(point.shape, *(c.shape for c in columns))
    rotation = np.stack([np.broadcast_to(c, shape) for c in columns], axis=1)
    return point, rotation, tuple(screws)


def twists_of(
    group: Group,
    screws: tuple[Screw, ...],
    columns: list[tuple[tuple[int, Array | None], ...]],
    origin: Numbers,
    size: float,
    dtype: np.dtype[np.generic],
) -> Numbers:
    """Scaled twists (6, n_columns, L, N) of variables given as (element, factor) pairs."""
    out = np.empty((6, len(columns), group.count, origin.shape[-1]), dtype=dtype)
    for j, column in enumerate(columns):
        for i, (k, factor) in enumerate(column):
            screw = screws[k]
            if i == 0 and factor is None:
                screw.twist(origin, size, out[:, j])
                continue
            part = np.empty_like(out[:, j])
            screw.twist(origin, size, part)
            if factor is not None:
                part *= factor
            if i == 0:
                out[:, j] = part
            else:
                out[:, j] += part
    return out
