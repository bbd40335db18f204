"""What of the measuring setup is not exactly known: nests, planes that are touched, zeros.

Their unknowns stand behind the effects' and before the frames. A nest with a covariance moves along
its principal axes (along x, y, z where these are independent); a plane along its normal and about
two axes in it; an instrument's zero is a constant of its readings, its scale a part of them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Situation
from calib.effects.lever import apply
from calib.mechanism.rigid import rotate
from calib.model.observing import Ends
from calib.runs.sensed import Sensed, SpreadNest
from calib.runs.stack import Rows

UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class SetupUnknown:
    """A number of the setup: where its prior has its mean, and that one's standard deviation.

    ``nest`` with ``axis`` (3,); or the number of a ``plane`` and ``part`` (0 along its normal,
    1 and 2 about an axis in it); or the number of a ``zero`` or of a ``scale``.
    """

    name: str
    unit: str
    centre: float
    sigma: float
    nest: SpreadNest | None = None
    axis: Array | None = None
    plane: int = -1
    part: int = 0
    zero: int = -1
    scale: int = -1


class SetupUnknowns:
    """Unknowns of the setup of some rows; none for plain points in exact nests."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.unknowns = tuple(_unknowns(rows.sensed)) if rows.sensed is not None else ()

    @property
    def centre(self) -> Array:
        """Means of the priors (S,)."""
        return np.array([one.centre for one in self.unknowns])

    @property
    def sigma(self) -> Array:
        """Standard deviations of the priors (S,)."""
        return np.array([one.sigma for one in self.unknowns])

    def nests(self, values: Array) -> Array:
        """Where the SMRs are (3, N) in their body, mm."""
        return self._shifted(self.rows.nest, values, self._at)

    def ends(self, values: Array, rotation: Array) -> Ends:
        """What the readings refer to; ``rotation`` (3, 3, N) of the platform in the frame."""
        rows, sensed = self.rows, self._sensed
        normal, offset = sensed.axis.copy(), np.zeros(rows.count)
        for k, named in enumerate(sensed.planes):
            here = sensed.plane == k
            n, d = self._plane(k, values)
            normal[:, here], offset[here] = n[:, None], float(n @ named.plane.through) + d
        return Ends(
            second=self._shifted(sensed.second, values, self._at_second),
            normal=normal,
            offset=offset,
            zero=self._of_instruments(values, "zero"),
            scale=self._of_instruments(values, "scale"),
            rotation=rotation,
            up=self._up,
        )

    def columns(self, situation: Situation, values: Array) -> Array:
        """Whitened derivatives (S, 3, N)."""
        rows = self.rows
        out = np.zeros((len(self.unknowns), 3, rows.count))
        scalar = rows.whitener[:, 0]
        gain = 1.0 + self._of_instruments(values, "scale")
        for own, one in zip(out, self.unknowns, strict=True):
            if one.nest is not None:
                assert one.axis is not None
                along = np.repeat(one.axis[:, None], rows.count, axis=1)
                carried = np.where(rows.on_platform, rotate(situation.rotation, along), along)
                moved = carried * self._at(one.nest.name) - along * self._at_second(one.nest.name)
                own[:] = apply(situation.whitener, rotate(situation.frame_rotation, moved))
            elif one.plane >= 0:
                here = self._sensed.plane == one.plane
                own[:] = scalar * (self._plane_slope(one, values, situation.point) * here * gain)
            elif one.zero >= 0:
                own[:] = scalar * (self._sensed.zero == one.zero) * gain
            else:
                assert situation.read is not None
                own[:] = scalar * (situation.read[0] / gain * (self._sensed.scale == one.scale))
        return out

    def _of_instruments(self, values: Array, what: str) -> Array:
        """Zero or scale (N,) of the instrument of each reading."""
        found, index = np.zeros(self.rows.count), getattr(self._sensed, what)
        for one, value in zip(self.unknowns, values, strict=True):
            if (number := getattr(one, what)) >= 0:
                found[index == number] = value
        return found

    @property
    def _sensed(self) -> Sensed:
        assert self.rows.sensed is not None
        return self.rows.sensed

    def _at(self, name: str) -> BoolArray:
        return np.array([one == name for one in self.rows.nest_name], dtype=bool)

    def _at_second(self, name: str) -> BoolArray:
        return np.array([one == name for one in self._sensed.second_name], dtype=bool)

    def _shifted(self, places: Array, values: Array, at: Callable[[str], BoolArray]) -> Array:
        moved = places.copy()
        for one, value in zip(self.unknowns, values, strict=True):
            if one.nest is not None and one.axis is not None:
                moved += np.outer(one.axis, at(one.nest.name) * (value - one.centre))
        return moved

    def _turns(self, plane: int, values: Array) -> Array:
        """Offset and two tilts (3,) of a plane."""
        found = np.zeros(3)
        for one, value in zip(self.unknowns, values, strict=True):
            if one.plane == plane:
                found[one.part] = value
        return found

    def _plane(self, plane: int, values: Array) -> tuple[Array, float]:
        """Unit normal (3,) and offset along it, mm."""
        offset, first, second = self._turns(plane, values)
        normal = self._sensed.planes[plane].plane.normal
        e1, e2 = _across(normal)
        n = normal + first * e1 + second * e2
        return n / np.linalg.norm(n), float(offset)

    def _plane_slope(self, one: SetupUnknown, values: Array, point: Array) -> Array:
        """Derivative (N,) of the distance from a plane, n . (p - c) - d."""
        if one.part == 0:
            return -np.ones(point.shape[1])
        plane = self._sensed.planes[one.plane].plane
        _, first, second = self._turns(one.plane, values)
        e = _across(plane.normal)
        n = plane.normal + first * e[0] + second * e[1]
        size, along = float(np.linalg.norm(n)), (first, second)[one.part - 1]
        slope = e[one.part - 1] / size - n * along / size**3
        return np.asarray(slope @ (point - plane.through[:, None]))

    @cached_property
    def _up(self) -> Array:
        """Against gravity (3, N), base frame."""
        ups = []
        for run in self.rows.runs:
            load = run.header.load
            down = np.array(UP) * -1.0 if load is None else load.gravity
            size = float(np.linalg.norm(down))
            ups.append(-down / size if size > 0.0 else np.array(UP))
        return np.array(ups).T[:, self.rows.run]


def _unknowns(sensed: Sensed) -> Iterator[SetupUnknown]:
    for nest in sensed.nests:
        yield from _of_nest(nest)
    for k, (name, plane) in enumerate(sensed.planes):
        if plane.sigma > 0.0:
            yield SetupUnknown(f"plane.{name}.offset", "mm", 0.0, plane.sigma, plane=k)
        if plane.tilt_sigma > 0.0:
            for part in (1, 2):
                yield SetupUnknown(
                    f"plane.{name}.tilt{part}", "rad", 0.0, plane.tilt_sigma, plane=k, part=part
                )
    for k, zero in enumerate(sensed.zeros):
        yield SetupUnknown(zero.name, zero.unit, 0.0, zero.sigma, zero=k)
    for k, scale in enumerate(sensed.scales):
        yield SetupUnknown(scale.name, scale.unit, 0.0, scale.sigma, scale=k)


def _of_nest(nest: SpreadNest) -> Iterator[SetupUnknown]:
    independent = np.allclose(nest.covariance, np.diag(np.diag(nest.covariance)), atol=0.0)
    if independent:
        variances, axes, names = np.diag(nest.covariance), np.eye(3), ("x", "y", "z")
    else:
        variances, vectors = np.linalg.eigh(nest.covariance)
        axes, names = vectors.T, ("axis1", "axis2", "axis3")
    for name, variance, axis in zip(names, variances, axes, strict=True):
        if variance > 1e-12 * float(np.max(variances)):
            yield SetupUnknown(
                f"nest.{nest.name}.{name}", "mm", float(axis @ nest.centre),
                float(np.sqrt(variance)), nest=nest, axis=axis,
            )  # fmt: skip


def _across(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) at right angles to ``normal`` and one another."""
    least = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, least)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)
