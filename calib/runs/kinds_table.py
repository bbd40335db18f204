"""``points.csv`` of version 2: rows of several kinds, each with the columns of its own."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.errors import BadInput
from calib.mechanism.rigid import from_euler
from calib.runs.cells import SMALLEST_SIGMA, meant_in
from calib.runs.header import Header
from calib.runs.points import (
    COVARIANCES,
    POSITION,
    SIGMAS,
    Array,
    _check_nests,
    _check_time,
    _Table,
)
from calib.runs.record import Run
from calib.runs.sensing import (
    ANGLES,
    DIRECTION,
    DISTANCE,
    KINDS,
    POINT,
    POSE,
    TILT,
    Instrument,
    Sensing,
    Setup,
)

EULER = ("rx", "ry", "rz")
QUATERNION = ("qw", "qx", "qy", "qz")
TURNS = tuple(f"s{name}" for name in EULER)
CIRCLES, CIRCLE_SIGMAS = ("azimuth", "elevation"), ("sazimuth", "selevation")
SIX = (*POSITION, *EULER)
POSE_COVARIANCES = {f"s{SIX[i]}{SIX[j]}": (i, j) for i in range(6) for j in range(i + 1, 6)}
TEXTS = ("kind", "instrument", "nest2", "plane", "pose2")
AXIS = ("ax", "ay", "az")
NUMBERS = (
    *POSITION, *SIGMAS, *COVARIANCES, "value", "sigma", *CIRCLES, *CIRCLE_SIGMAS, *EULER,
    *QUATERNION, *TURNS, *(name for name in POSE_COVARIANCES if name not in COVARIANCES), *AXIS,
)  # fmt: skip
"""Numeric columns of version 2 that are no channels, each optional as a column."""
_WANTED = {
    POINT: "x, y, z with sx, sy, sz (some may be empty)",
    DIRECTION: "value and sigma",
    DISTANCE: "value and sigma",
    ANGLES: "azimuth, elevation with sazimuth, selevation (one may be empty)",
    TILT: "value and sigma",
    POSE: "x, y, z, rx, ry, rz (or qw, qx, qy, qz) with sx .. srz",
}
_OWN = {
    POINT: {*POSITION, *SIGMAS, *COVARIANCES},
    DIRECTION: {"value", "sigma", *AXIS, "plane"},
    DISTANCE: {"value", "sigma", "nest2", "pose2"},
    ANGLES: {*CIRCLES, *CIRCLE_SIGMAS},
    TILT: {"value", "sigma", *AXIS},
    POSE: {*SIX, *SIGMAS, *TURNS, *QUATERNION, *POSE_COVARIANCES},
}


def points_of_kinds(table: _Table, header: Header, setup: Setup, actuators: int) -> Run:
    """Read the rows of a run of version 2; raises BadInput with line, column and remedy."""
    n_columns = table.actuator_columns(actuators, header.machine)
    for name in ("time_s", "pose", "nest", *n_columns):
        if not table.has(name):
            table.require((name,))
    _check_nests(table, tuple(table.cells("nest")), header)
    time_s = table.numbers("time_s")
    _check_time(table, time_s)
    reader = _Reader(table, header, setup, _Blank(time_s.size).made())
    for row in range(time_s.size):
        reader.read(row)
    made = reader.made
    measured = made.kind >= 0
    if not measured.any():
        raise BadInput(
            "no row holds a reading", place=table.source, remedy="Measure before analysing"
        )
    fixed = {"time_s", "pose", "nest", *n_columns, *TEXTS, *NUMBERS}
    channels, left_aside = table.channels([name for name in table.names if name not in fixed])
    made.value[:, ~measured] = np.nan
    made.covariance[:, :, ~measured] = np.nan
    return Run(
        header=header,
        source=table.source,
        line=np.array(table.lines, dtype=np.int64),
        time_s=time_s,
        pose=tuple(table.cells("pose")),
        nest=tuple(reader.nest_of(row) for row in range(time_s.size)),
        q=np.array([table.numbers(name) for name in n_columns]),
        measured=measured,
        position=made.value,
        covariance=made.covariance,
        channels=channels,
        left_aside=left_aside,
        sensing=Sensing(
            kind=made.kind,
            instrument=tuple(made.instrument),
            second=tuple(reader.second_of(row) for row in range(time_s.size)),
            plane=tuple(made.plane),
            ends=made.ends,
            seen=made.seen,
            axis=made.axis,
            attitude=made.attitude,
            spread=made.spread,
        ),
    )


@dataclass(eq=False)
class _Made:
    """What has been read so far, row by row."""

    value: Array
    covariance: Array
    kind: NDArray[np.intp]
    instrument: list[str]
    second: list[str]
    plane: list[str]
    ends: NDArray[np.intp]
    seen: NDArray[np.bool_]
    axis: Array
    attitude: Array
    spread: Array


@dataclass(frozen=True)
class _Blank:
    """N rows of which nothing is read yet."""

    count: int

    def made(self) -> _Made:
        n = self.count
        return _Made(
            value=np.zeros((3, n)),
            covariance=np.zeros((3, 3, n)),
            kind=np.full(n, -1, dtype=np.intp),
            instrument=[""] * n,
            second=[""] * n,
            plane=[""] * n,
            ends=np.full((2, n), -1, dtype=np.intp),
            seen=np.zeros((3, n), dtype=bool),
            axis=np.zeros((3, n)),
            attitude=np.repeat(np.eye(3)[:, :, None], n, axis=2),
            spread=np.zeros((6, 6, n)),
        )


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads rows, each by its kind."""

    table: _Table
    header: Header
    setup: Setup
    made: _Made

    def read(self, row: int) -> None:
        """Read one row, or leave it a move."""
        nest, kind_name = self.text(row, "nest"), self.text(row, "kind")
        if not nest:
            self._check_move(row)
            return
        kind_name = kind_name or "point"
        if kind_name not in KINDS:
            raise self.table.wrong(row, "kind", f"one of {', '.join(KINDS)}")
        kind = KINDS.index(kind_name)
        instrument = self._instrument(row)
        self.made.kind[row] = kind
        self._check_own(row, kind)
        if kind in (TILT, POSE) and nest not in self.header.platform_nests:
            raise self.table.wrong(row, "nest", f"a nest of the platform for the kind {kind_name}")
        if kind in (POINT, ANGLES):
            some = self._components(row, kind)
            if not some:
                raise self.fault(row, "kind", f"the row holds no reading: {_WANTED[kind]}")
        elif kind == POSE:
            self._pose(row)
        else:
            self._value(row, kind, instrument)

    # ------------------------------------------------------------------ cells

    def text(self, row: int, name: str) -> str:
        return self.table.cells(name)[row] if self.table.has(name) else ""

    def exchanged(self, row: int) -> bool:
        """Whether a distance is from the base to the platform: the moving end stands first."""
        platform = self.header.platform_nests
        return self.made.second[row] in platform and self.text(row, "nest") not in platform

    def nest_of(self, row: int) -> str:
        return self.made.second[row] if self.exchanged(row) else self.text(row, "nest")

    def second_of(self, row: int) -> str:
        return self.text(row, "nest") if self.exchanged(row) else self.made.second[row]

    def number(self, row: int, name: str) -> float | None:
        """A finite number, or None where the field is empty or there is no such column."""
        cell = self.text(row, name)
        if not cell:
            return None
        value = meant_in(cell)
        if value is None:
            raise self.table.wrong(row, name, "a finite number, or an empty field")
        return value

    def needed(self, row: int, name: str, what: str) -> float:
        value = self.number(row, name)
        if value is None:
            raise self.fault(row, name, f"{name} is missing: expected {what}")
        return value

    def sigma(self, row: int, name: str, of: str) -> float:
        value = self.number(row, name)
        if value is None:
            raise self.fault(row, name, f"{of} has no standard uncertainty {name}")
        if value < SMALLEST_SIGMA:
            raise self.table.wrong(row, name, "a standard uncertainty, larger than zero")
        return value

    def fault(self, row: int, column: str, what: str, remedy: str = "") -> BadInput:
        kind = KINDS[self.made.kind[row]]
        return BadInput(
            what,
            place=self.table.place(row, column),
            remedy=remedy or f"A row of kind {kind} holds {_WANTED[KINDS.index(kind)]}",
        )

    # ------------------------------------------------------------------ what every kind has

    def _check_move(self, row: int) -> None:
        for name in (*TEXTS, *NUMBERS):
            if self.text(row, name):
                raise self.table.wrong(
                    row, name, "an empty field, since no nest is named: a move only"
                )

    def _check_own(self, row: int, kind: int) -> None:
        for name in ("nest2", "plane", "pose2", *NUMBERS):
            if name not in _OWN[kind] and self.text(row, name):
                raise self.fault(
                    row, name, f"{name} = {self.text(row, name)} in a row of kind {KINDS[kind]}"
                )

    def _instrument(self, row: int) -> Instrument:
        name = self.text(row, "instrument")
        known = self.setup.instruments
        if name and name not in known:
            raise BadInput(
                f"unknown instrument {name!r}",
                place=self.table.place(row, "instrument"),
                remedy=f"Expected one of {', '.join(known) or '(none is in run.toml)'}; "
                f"write [instruments.{name}] in run.toml",
            )
        if not name and len(known) > 1:
            raise BadInput(
                "the row does not say which instrument measured",
                place=self.table.place(
                    row, "instrument" if self.table.has("instrument") else "nest"
                ),
                remedy=f"Expected one of {', '.join(known)} in the column instrument",
            )
        name = name or next(iter(known), "")
        self.made.instrument[row] = name
        return known[name] if name else Instrument()

    # ------------------------------------------------------------------ by kind

    def _components(self, row: int, kind: int) -> bool:
        """Components of a point or of angles, some of which may be missing."""
        names, sigmas = (POSITION, SIGMAS) if kind == POINT else (CIRCLES, CIRCLE_SIGMAS)
        made = self.made
        for axis, (name, sigma) in enumerate(zip(names, sigmas, strict=True)):
            value = self.number(row, name)
            if value is None:
                if self.text(row, sigma):
                    raise self.fault(row, name, f"{sigma} is given, but {name} is empty")
                continue
            made.value[axis, row] = value
            made.covariance[axis, axis, row] = self.sigma(row, sigma, name) ** 2
            made.seen[axis, row] = True
        if kind == POINT:
            self._off_diagonal(row, made.covariance[:, :, row], POSE_COVARIANCES, COVARIANCES)
        elif made.seen[1, row] and abs(made.value[1, row]) > 0.5 * math.pi:
            raise self.table.wrong(row, "elevation", "an elevation in rad, -pi/2 .. pi/2")
        return bool(made.seen[:, row].any())

    def _off_diagonal(
        self, row: int, matrix: Array, pairs: dict[str, tuple[int, int]], names: Sequence[str]
    ) -> None:
        for name in names:
            value = self.number(row, name)
            if value is None or value == 0.0:
                continue
            i, j = pairs[name]
            if matrix[i, i] == 0.0 or matrix[j, j] == 0.0:
                raise self.fault(row, name, f"{name} is given, but one of the two is not measured")
            matrix[i, j] = matrix[j, i] = value
        there = np.diag(matrix) > 0.0
        own = matrix[np.ix_(there, there)]
        scale = np.sqrt(np.diag(own))
        if own.size and np.linalg.eigvalsh(own / scale / scale[:, None])[0] <= 1e-9:
            raise BadInput(
                "the covariance matrix is not positive definite",
                place=self.table.place(row, names[0] if self.table.has(names[0]) else SIGMAS[0]),
                remedy="Expected covariances with |sab| < sa sb",
            )

    def _pose(self, row: int) -> None:
        made = self.made
        for axis, name in enumerate(POSITION):
            made.value[axis, row] = self.needed(row, name, "a place in mm")
            made.spread[axis, axis, row] = self.sigma(row, SIGMAS[axis], name) ** 2
        for axis, name in enumerate(TURNS):
            made.spread[3 + axis, 3 + axis, row] = self.sigma(row, name, EULER[axis]) ** 2
        self._off_diagonal(row, made.spread[:, :, row], POSE_COVARIANCES, tuple(POSE_COVARIANCES))
        made.covariance[:, :, row] = made.spread[:3, :3, row]
        made.attitude[:, :, row] = self._attitude(row)
        made.seen[:, row] = True

    def _attitude(self, row: int) -> Array:
        by_quaternion = any(self.text(row, name) for name in QUATERNION)
        by_euler = any(self.text(row, name) for name in EULER)
        if by_quaternion == by_euler:
            found = "both a quaternion and angles" if by_euler else "no attitude"
            raise self.fault(row, "rx" if self.table.has("rx") else "qw", f"{found} in the row")
        if by_euler:
            angles = [np.array(self.needed(row, name, "an angle in rad")) for name in EULER]
            return np.asarray(from_euler(*angles), dtype=np.float64)
        w, x, y, z = (self.needed(row, name, "four numbers of norm 1") for name in QUATERNION)
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        if abs(norm - 1.0) > 1e-3:
            raise BadInput(
                f"the quaternion has the norm {norm:.6g}",
                place=self.table.place(row, "qw"),
                remedy="Expected norm 1, scalar first: qw, qx, qy, qz",
            )
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    def _value(self, row: int, kind: int, instrument: Instrument) -> None:
        made = self.made
        value = made.value[0, row] = self.needed(row, "value", _WANTED[kind])
        made.covariance[0, 0, row] = self.sigma(row, "sigma", "value") ** 2
        made.seen[0, row] = True
        if kind == DISTANCE:
            self._distance(row, value, instrument)
        elif kind == DIRECTION and self.text(row, "plane"):
            self._plane(row, value, instrument)
        else:
            made.axis[:, row] = self._axis(row, kind, instrument)
        if kind == TILT and abs(value) > 0.5 * math.pi:
            raise self.table.wrong(row, "value", "a tilt in rad, -pi/2 .. pi/2")

    def _axis(self, row: int, kind: int, instrument: Instrument) -> Array:
        given = [self.number(row, name) for name in AXIS]
        if all(one is None for one in given):
            if instrument.axis is None:
                what = "no axis: neither ax, ay, az, nor a plane, nor the instrument's axis"
                if kind == TILT:
                    what = "no axis: neither ax, ay, az, nor the instrument's axis"
                raise self.fault(row, "kind", what, "Write axis = [0.0, 0.0, 1.0] in run.toml")
            return instrument.axis
        axis = np.array([self.needed(row, name, "a direction of length 1") for name in AXIS])
        length = float(np.linalg.norm(axis))
        if abs(length - 1.0) > 1e-3:
            raise self.fault(
                row, "ax", f"the axis has the length {length:.6g}", "Expected a length of 1"
            )
        return np.asarray(axis / length)

    def _plane(self, row: int, value: float, instrument: Instrument) -> None:
        name = self.text(row, "plane")
        if name not in self.setup.planes:
            raise BadInput(
                f"unknown plane {name!r}",
                place=self.table.place(row, "plane"),
                remedy=f"Write [planes.{name}] in run.toml",
            )
        if any(self.text(row, column) for column in AXIS):
            raise self.fault(row, "ax", "both a plane and an axis", "Leave one of them empty")
        if instrument.frame != "base":
            raise self.fault(
                row, "plane", "mixed frames: planes are in the base frame, the instrument is not",
                f'Write frame = "base" in [instruments.{self.made.instrument[row] or "NAME"}]',
            )  # fmt: skip
        if value < 0.0 and instrument.zero_sigma is None:
            raise self.fault(
                row, "value", f"the plane {name} is touched from behind ({value:g} mm)",
                "Turn its normal to the side that is touched; a distance from it is not negative",
            )  # fmt: skip
        self.made.plane[row] = name

    def _distance(self, row: int, value: float, instrument: Instrument) -> None:
        header, second = self.header, self.text(row, "nest2")
        if value <= 0.0 and instrument.zero_sigma is None:
            raise self.table.wrong(row, "value", "a distance in mm, larger than zero")
        if self.text(row, "pose2"):
            self._marks(row, second or self.text(row, "nest"))
            return
        if not second:
            if instrument.frame != "free":
                raise self.fault(
                    row, "nest2", "a distance from nowhere",
                    "Name the other nest in nest2, or an instrument with a frame of its own",
                )  # fmt: skip
            return
        if second not in header.platform_nests and second not in header.base_nests:
            known = ", ".join([*header.platform_nests, *header.base_nests])
            raise self.table.wrong(row, "nest2", f"one of {known} (run.toml)")
        if second == self.text(row, "nest"):
            raise self.table.wrong(row, "nest2", "another nest than in the column nest")
        self.made.second[row] = second

    def _marks(self, row: int, second: str) -> None:
        """Ends of a distance between marks that the platform has left at two poses."""
        labels = [self.text(row, name) for name in ("pose", "pose2")]
        for name, nest in (("nest", self.text(row, "nest")), ("nest2", second)):
            if nest not in self.header.platform_nests:
                raise self.table.wrong(row, name, "a nest of the platform, which left the mark")
        for end, (column, label) in enumerate(zip(("pose", "pose2"), labels, strict=True)):
            before = [
                k for k in range(row)
                if self.text(k, "pose") == label and self.made.ends[0, k] < 0
            ]  # fmt: skip
            if not label or not before:
                raise self.table.wrong(row, column, "a pose of an earlier row")
            self.made.ends[end, row] = before[-1]
        if self.made.ends[0, row] == self.made.ends[1, row] and second == self.text(row, "nest"):
            raise self.table.wrong(row, "pose2", "another pose than in the column pose")
        self.made.second[row] = second
