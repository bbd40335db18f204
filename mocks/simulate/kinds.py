"""Runs of several kinds of readings, with physics of their own: what a laboratory writes down.

Where the platform truly stands is given (3,), (3, 3); what instruments read of it, with their
noise, is made here, and written as the two files of a run of version 2.
"""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

Array = NDArray[np.float64]

COLUMNS = (
    "x", "y", "z", "sx", "sy", "sz", "value", "sigma", "azimuth", "elevation", "sazimuth",
    "selevation", "qw", "qx", "qy", "qz", "srx", "sry", "srz", "ax", "ay", "az",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Stand:
    """The base in an instrument's frame: rotation (3, 3), position (3,) mm."""

    rotation: Array
    position: Array

    def of(self, point: Array) -> Array:
        """A point (3,) of the base frame as the instrument has it."""
        return np.asarray(self.rotation @ point + self.position)


@dataclass(eq=False)
class Laboratory:
    """A machine, nests as they truly are (3,) mm, and what is written of them.

    ``header`` is ``run.toml`` as plain data, with the nests as they are *stated*.
    """

    header: dict[str, Any]
    platform: Mapping[str, Array]
    base: Mapping[str, Array]
    actuators: int
    rng: np.random.Generator
    stands: Mapping[str, Stand] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)
    place: Array = field(default_factory=lambda: np.zeros(3))
    turn: Array = field(default_factory=lambda: np.eye(3))
    _stood: dict[tuple[str, str], Array] = field(default_factory=dict)
    _pose: str = ""
    _q: Sequence[float] = ()

    def go(self, pose: str, q: Sequence[float], place: Array, turn: Array) -> None:
        """Stand at a pose: its label, commanded q, where the platform truly is."""
        self._pose, self._q, self.place, self.turn = pose, q, place, turn
        self._stood |= {(nest, pose): self.where(nest) for nest in self.platform}

    def move(self) -> None:
        """Write that the machine was here, without a reading."""
        self._write("", "", "", {})

    def where(self, nest: str) -> Array:
        """Centre (3,) of a nest in the base frame."""
        if nest in self.platform:
            return np.asarray(self.place + self.turn @ self.platform[nest])
        return self.base[nest]

    def point(
        self, nest: str, sigma: float, *, by: str = "", only: str = "xyz", vague: float = 0.0
    ) -> None:
        """Read a point, or ``only`` some components; others by ``vague`` mm if that is not zero."""
        seen = self._stand(by).of(self.where(nest))
        cells = {}
        for axis, name in enumerate("xyz"):
            spread = sigma if name in only else vague
            if spread:
                cells[name] = seen[axis] + spread * self.rng.standard_normal()
                cells[f"s{name}"] = spread
        self._write("point", by, nest, cells)

    def direction(
        self, nest: str, axis: Array, sigma: float, *, by: str, zero: float = 0.0, long: float = 0.0
    ) -> None:
        """Read a dial gauge along an axis of its frame, which shows too much by a part ``long``."""
        along = (float(axis @ self._stand(by).of(self.where(nest))) + zero) * (1.0 + long)
        cells = dict(zip(("ax", "ay", "az"), axis.tolist(), strict=True))
        self._write("direction", by, nest, {**cells, **self._scalar(along, sigma)})

    def touch(
        self, nest: str, plane: str, normal: Array, through: Array, sigma: float, *, by: str
    ) -> None:
        """Read the distance of a nest from a plane as it truly is."""
        apart = float(normal @ (self.where(nest) - through))
        self._write("direction", by, nest, {"plane": plane, **self._scalar(apart, sigma)})

    def distance(
        self, nest: str, other: str, sigma: float, *, by: str = "", zero: float = 0.0
    ) -> None:
        """Read how far two nests are apart; ``other`` empty: from the instrument."""
        here = self.where(nest)
        apart = here - self.where(other) if other else self._stand(by).of(here)
        length = math.sqrt(float(apart @ apart)) + zero
        self._write("distance", by, nest, {"nest2": other, **self._scalar(length, sigma)})

    def marks(
        self, nest: str, first: str, second: str, sigma: float, *, by: str = "", long: float = 0.0
    ) -> None:
        """Read how far apart the marks are that a nest has left at two poses (calipers)."""
        apart = self._stood[nest, first] - self._stood[nest, second]
        cells = self._scalar(math.sqrt(float(apart @ apart)) * (1.0 + long), sigma)
        self._write("distance", by, nest, {"pose": first, "pose2": second, **cells})

    def angles(self, nest: str, sigma: float, *, by: str, only: str = "both") -> None:
        """Read azimuth and elevation in rad, or one of them."""
        x, y, z = self._stand(by).of(self.where(nest))
        read = {"azimuth": math.atan2(y, x), "elevation": math.asin(z / math.hypot(x, y, z))}
        cells = {}
        for name, value in read.items():
            if only in ("both", name):
                cells[name] = value + sigma * self.rng.standard_normal()
                cells[f"s{name}"] = sigma
        self._write("angles", by, nest, cells)

    def tilt(self, nest: str, axis: Array, sigma: float, *, by: str, zero: float = 0.0) -> None:
        """Read how far an axis of the platform points up, rad."""
        up = math.asin(float((self.turn @ axis)[2])) + zero
        cells = dict(zip(("ax", "ay", "az"), axis.tolist(), strict=True))
        self._write("tilt", by, nest, {**cells, **self._scalar(up, sigma)})

    def pose(self, nest: str, sigma_mm: float, sigma_rad: float, *, by: str) -> None:
        """Read place and attitude of a target on the platform, as a quaternion."""
        stand = self._stand(by)
        seen = stand.of(self.where(nest)) + sigma_mm * self.rng.standard_normal(3)
        error = sigma_rad * self.rng.standard_normal(3)
        turned = _quaternion(_turned_by(error) @ stand.rotation @ self.turn)
        cells = dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), [*seen, *turned], strict=True))
        cells |= dict.fromkeys(("sx", "sy", "sz"), sigma_mm)
        self._write("pose", by, nest, cells | dict.fromkeys(("srx", "sry", "srz"), sigma_rad))

    def texts(self) -> tuple[str, str]:
        """``run.toml`` and ``points.csv``."""
        used = [name for name in COLUMNS if any(name in row for row in self.rows)]
        q = [f"q{k + 1}" for k in range(self.actuators)]
        names = [
            "time_s",
            "pose",
            "kind",
            "instrument",
            "nest",
            "nest2",
            "plane",
            "pose2",
            *q,
            *used,
        ]
        target = io.StringIO()
        writer = csv.DictWriter(target, names, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        return tomli_w.dumps({"format": "pkm-run/2", **self.header}), target.getvalue()

    def _stand(self, name: str) -> Stand:
        return self.stands.get(name, Stand(np.eye(3), np.zeros(3)))

    def _scalar(self, value: float, sigma: float) -> dict[str, Any]:
        return {"value": value + sigma * self.rng.standard_normal(), "sigma": sigma}

    def _write(self, kind: str, by: str, nest: str, cells: Mapping[str, Any]) -> None:
        row: dict[str, Any] = {
            "time_s": 10.0 * len(self.rows), "pose": self._pose if nest not in self.base else "",
            "kind": kind, "instrument": by, "nest": nest,
        }  # fmt: skip
        row |= {f"q{k + 1}": value for k, value in enumerate(self._q)}
        row |= {name: float(v) if name in COLUMNS else v for name, v in cells.items()}
        self.rows.append(row)


def _turned_by(w: Array) -> Array:
    """Rotation by a small vector (3,), rad."""
    x, y, z = w
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + skew + 0.5 * skew @ skew)


def _quaternion(R: Array) -> list[float]:
    """Unit quaternion, scalar first, of a rotation: eigenvector of Bar-Itzhack's matrix (2000)."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = R.reshape(-1)
    K = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    x, y, z, w = np.linalg.eigh(K)[1][:, -1]
    return [float(w), float(x), float(y), float(z)]
