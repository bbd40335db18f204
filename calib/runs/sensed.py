"""How the components of stacked readings follow from what is where: one block of three a reading.

Whatever its kind, a reading is a block of up to three components; those that it does not hold
carry no information. A pose is two blocks: its place, and its attitude given the place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.errors import BadInput
from calib.runs.record import Run
from calib.runs.sensing import (
    ANGULAR,
    DIRECTION,
    DISTANCE,
    KINDS,
    POSE,
    TILT,
    Plane,
    Setup,
)

LENGTHS = (DIRECTION, DISTANCE)
"""Kinds of one length: a gauge, calipers or a bar may have a scale of its own."""
BASE = -1
"""Frame of instruments that measure in the base frame."""


class FrameOf(NamedTuple):
    """A base frame to be found: of which run, seen by which instrument, roughly where (6,)."""

    run: int
    instrument: str
    near: Array | None


class SpreadNest(NamedTuple):
    """A nest that is not exact: name, on the platform?, centre (3,), covariance (3, 3)."""

    name: str
    on_platform: bool
    centre: Array
    covariance: Array


class NamedPlane(NamedTuple):
    """A plane that is touched."""

    name: str
    plane: Plane


class Shared(NamedTuple):
    """A number that readings of an instrument share: name, unit, standard deviation."""

    name: str
    unit: str
    sigma: float


class Blocks(NamedTuple):
    """Blocks of one run.

    Row (N,) of the reading; row (N,) at which the platform stood as it says; which are attitudes
    and ghosts (N,); nests.
    """

    rows: IntArray
    stood: IntArray
    turn: BoolArray
    ghost: BoolArray
    nest: tuple[str, ...]


_ARRAYS = (
    "kind", "frame", "seen", "axis", "second", "plane", "zero", "scale", "attitude", "turn",
    "ghost", "root", "whitener", "turner",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sensed:
    """What N blocks measure.

    Attributes
    ----------
    kind : (N,)
        Index in :data:`calib.runs.sensing.KINDS`.
    frame : (N,)
        Which of ``frames``; ``BASE`` where the base's own axes are measured along.
    seen : (3, N) bool
        Components that are held.
    axis : (3, N)
        Of a direction, in the instrument's frame; of a tilt, in the platform frame.
    second, second_name : (3, N), tuple
        The other end of a distance: base frame, or platform frame where both are on it. nan and
        empty where there is none: zero is the instrument.
    plane, zero, scale : (N,)
        Which of ``planes``, ``zeros`` and ``scales``; -1 for none.
    attitude, turn : (3, 3, N), (N,) bool
        Of the platform in the instrument's frame, in the blocks that are an attitude.
    ghost, partner : (N,) bool, (N,)
        Blocks that only say where the other end of a distance between two poses stood; and the
        ghost of each such distance, else -1. A ghost holds nothing: what it would say is folded
        into its distance.
    root, whitener, turner : (3, 3, N)
        residual = root @ whitened; whitened = whitener @ residual + turner @ rotation, in mm or
        rad; zero where nothing is seen. The turner is zero but for attitudes.
    """

    kind: IntArray
    frame: IntArray
    seen: BoolArray
    axis: Array
    second: Array
    second_name: tuple[str, ...]
    plane: IntArray
    zero: IntArray
    scale: IntArray
    attitude: Array
    turn: BoolArray
    ghost: BoolArray
    partner: IntArray
    root: Array
    whitener: Array
    turner: Array
    frames: tuple[FrameOf, ...]
    planes: tuple[NamedPlane, ...]
    zeros: tuple[Shared, ...]
    scales: tuple[Shared, ...]
    nests: tuple[SpreadNest, ...]

    def take(self, chosen: IntArray) -> "Sensed":
        """Blocks selected by index."""
        place = np.full(self.partner.size + 1, -1, dtype=np.intp)
        place[chosen] = np.arange(chosen.size)
        return replace(
            self,
            partner=place[self.partner[chosen]],
            second_name=tuple(self.second_name[row] for row in chosen),
            **{name: getattr(self, name)[..., chosen] for name in _ARRAYS},
        )

    def fold(self, columns: Array) -> Array:
        """Whitened columns (..., N) with what is of ghosts in their distances."""
        far = np.flatnonzero(self.partner >= 0)
        if far.size == 0:
            return columns
        out = columns.copy()
        out[..., far] += columns[..., self.partner[far]]
        out[..., self.ghost] = 0.0
        return out

    @property
    def angular(self) -> BoolArray:
        """Blocks (N,) whose components are in rad."""
        return np.isin(self.kind, ANGULAR) | self.turn


def sensed(runs: Sequence[Run], blocks: Sequence[Blocks]) -> Sensed | None:
    """Blocks of several runs; None where all are plain points of one instrument a run."""
    if all(run.sensing is None for run in runs):
        return None
    found = _Listed()
    parts = [
        found.part(index, run, own)
        for index, (run, own) in enumerate(zip(runs, blocks, strict=True))
    ]
    ghost = np.concatenate([part["ghost"] for part in parts])
    partner = np.full(ghost.size, -1, dtype=np.intp)
    at = np.flatnonzero(ghost)
    partner[at - 1] = at
    return Sensed(
        partner=partner,
        second_name=tuple(name for part in parts for name in part["second_name"]),
        frames=tuple(found.frames),
        planes=tuple(found.planes.values()),
        zeros=tuple(found.zeros),
        scales=tuple(found.scales),
        nests=tuple(found.nests.values()),
        **{name: np.concatenate([part[name] for part in parts], axis=-1) for name in _ARRAYS},
    )


class _Listed:
    """What all runs refer to: geometry is shared; frames, zeros and scales are not."""

    def __init__(self) -> None:
        self.frames: list[FrameOf] = []
        self.planes: dict[str, NamedPlane] = {}
        self.zeros: list[Shared] = []
        self.scales: list[Shared] = []
        self.nests: dict[str, SpreadNest] = {}

    def part(self, index: int, run: Run, blocks: Blocks) -> dict[str, Any]:
        """Arrays of one run's blocks."""
        rows, turn, ghost = blocks.rows, blocks.turn, blocks.ghost
        setup = run.header.setup or Setup()
        self._nests(run, setup)
        sensing, count = run.sensing, rows.size
        covariance = run.covariance[:, :, rows]
        if sensing is None:
            frame = len(self.frames)
            self.frames.append(FrameOf(index, "", None))
            root, whitener, turner = _whiteners(covariance, np.ones((3, count), dtype=bool))
            return {
                "kind": np.zeros(count, dtype=np.intp),
                "frame": np.full(count, frame, dtype=np.intp),
                "seen": np.ones((3, count), dtype=bool),
                "axis": np.zeros((3, count)),
                "second": np.full((3, count), np.nan),
                "second_name": ("",) * count,
                "plane": np.full(count, -1, dtype=np.intp),
                "zero": np.full(count, -1, dtype=np.intp),
                "scale": np.full(count, -1, dtype=np.intp),
                "attitude": np.repeat(np.eye(3)[:, :, None], count, axis=2),
                "turn": turn,
                "ghost": ghost,
                "root": root,
                "whitener": whitener,
                "turner": turner,
            }  # fmt: skip
        kind, seen = sensing.kind[rows], sensing.seen[:, rows]
        root, whitener, turner = _whiteners(covariance, seen)
        _of_poses(sensing.spread[:, :, rows], kind == POSE, turn, (root, whitener, turner))
        instrument = [sensing.instrument[row] for row in rows]
        marks = sensing.ends[0, rows] >= 0
        second_name = tuple(
            "" if mark else sensing.second[row] for row, mark in zip(rows, marks, strict=True)
        )
        nests = {**run.header.platform_nests, **run.header.base_nests, "": np.full(3, np.nan)}
        return {
            "kind": kind,
            "frame": self._frame(
                index, setup, kind, instrument, [sensing.second[row] for row in rows]
            ),
            "seen": seen & ~ghost,
            "axis": sensing.axis[:, rows],
            "second": np.array([nests[name] for name in second_name]).reshape(-1, 3).T,
            "second_name": second_name,
            "plane": self._plane(run, setup, [sensing.plane[row] for row in rows]),
            "zero": self._zero(index, setup, kind, instrument),
            "scale": self._scale(index, setup, kind, instrument),
            "attitude": sensing.attitude[:, :, rows],
            "turn": turn,
            "ghost": ghost,
            "root": root,
            "whitener": whitener,
            "turner": turner,
        }

    def _nests(self, run: Run, setup: Setup) -> None:
        header = run.header
        for name, covariance in setup.nests.items():
            on = name in header.platform_nests
            centre = header.platform_nests[name] if on else header.base_nests[name]
            known = self.nests.setdefault(name, SpreadNest(name, on, centre, covariance))
            if known.on_platform != on or not np.array_equal(known.centre, centre):
                raise BadInput(
                    f"the nest {name} is at another place than in the runs before",
                    place=run.source,
                    remedy="Give it another name where it is another nest",
                )

    def _frame(
        self,
        index: int,
        setup: Setup,
        kind: IntArray,
        instrument: Sequence[str],
        second: Sequence[str],
    ) -> IntArray:
        own: dict[str, int] = {}
        frame = np.full(kind.size, BASE, dtype=np.intp)
        for row, name in enumerate(instrument):
            of = setup.of(name)
            if kind[row] == TILT or second[row] or of.frame == "base":
                continue  # measured in the base frame, or between two nests
            if name not in own:
                own[name] = len(self.frames)
                self.frames.append(FrameOf(index, name, of.near))
            frame[row] = own[name]
        return frame

    def _plane(self, run: Run, setup: Setup, names: Sequence[str]) -> IntArray:
        listed = list(self.planes)
        for name in dict.fromkeys(names):
            if not name:
                continue
            plane = setup.planes[name]
            if name not in self.planes:
                self.planes[name] = NamedPlane(name, plane)
                listed.append(name)
            known = self.planes[name].plane
            if not (
                np.array_equal(known.normal, plane.normal)
                and np.array_equal(known.through, plane.through)
            ):
                raise BadInput(
                    f"the plane {name} lies elsewhere than in the runs before",
                    place=run.source,
                    remedy="Give it another name where it is another plane",
                )
        return np.array([listed.index(name) if name else -1 for name in names], dtype=np.intp)

    def _zero(
        self, index: int, setup: Setup, kind: IntArray, instrument: Sequence[str]
    ) -> IntArray:
        before = f"run{index + 1}." if index else ""
        return _listed(
            self.zeros,
            [
                Shared(
                    f"{before}{name}.zero",
                    "rad" if of == TILT else "mm",
                    sigma,
                )
                if (sigma := setup.of(name).zero_sigma) is not None
                and of in (DIRECTION, DISTANCE, TILT)
                else None
                for name, of in zip(instrument, kind, strict=True)
            ],
        )

    def _scale(
        self, index: int, setup: Setup, kind: IntArray, instrument: Sequence[str]
    ) -> IntArray:
        before = f"run{index + 1}." if index else ""
        return _listed(
            self.scales,
            [
                Shared(f"{before}{name}.scale", "1", sigma)
                if (sigma := setup.of(name).scale_sigma) is not None and of in LENGTHS
                else None
                for name, of in zip(instrument, kind, strict=True)
            ],
        )


def _listed(known: list[Shared], wanted: Sequence[Shared | None]) -> IntArray:
    """Index of each in a list to which those that are new are added, by name; -1 for None."""
    names = [one.name for one in known]
    for one in wanted:
        if one is not None and one.name not in names:
            names.append(one.name)
            known.append(one)
    return np.array([-1 if one is None else names.index(one.name) for one in wanted], dtype=np.intp)


def _whiteners(covariance: Array, seen: BoolArray) -> tuple[Array, Array, Array]:
    """Roots and whiteners (3, 3, N) of covariances whose components are not all ``seen`` (3, N)."""
    dead = ~seen
    full = np.where(dead[:, None] | dead[None, :], 0.0, covariance)
    full = full + np.where(dead, 1.0, 0.0)[:, None] * np.eye(3)[:, :, None]
    factors = np.linalg.cholesky(np.moveaxis(full, -1, 0))
    inverse = np.linalg.inv(factors)
    both = (seen[:, None] & seen[None, :]).astype(np.float64)
    root = np.moveaxis(factors, 0, -1) * both
    return np.ascontiguousarray(root), np.moveaxis(inverse, 0, -1) * both, np.zeros_like(root)


def _of_poses(
    spread: Array, pose: BoolArray, turn: BoolArray, into: tuple[Array, Array, Array]
) -> None:
    """Fill in what is of poses: attitudes are whitened of what they share with the place."""
    root, whitener, turner = into
    for row in np.flatnonzero(pose):
        factor = np.linalg.cholesky(spread[:, :, row])
        inverse = np.linalg.inv(factor)
        if turn[row]:
            root[:, :, row] = factor[3:, 3:]
            whitener[:, :, row] = inverse[3:, :3]
            turner[:, :, row] = inverse[3:, 3:]
        else:
            root[:, :, row], whitener[:, :, row] = factor[:3, :3], inverse[:3, :3]


def blocks_of(run: Run) -> Blocks:
    """Blocks of a run in order: one a reading, two for a pose and for a distance of two poses."""
    rows = np.flatnonzero(run.measured)
    none = np.zeros(rows.size, dtype=bool)
    if run.sensing is None:
        return Blocks(rows, rows, none, none, tuple(run.nest[row] for row in rows))
    marks = run.sensing.ends[0] >= 0
    twice = np.where((run.sensing.kind[rows] == POSE) | marks[rows], 2, 1)
    out = np.repeat(rows, twice)
    second = np.zeros(out.size, dtype=bool)
    second[1:] = out[1:] == out[:-1]
    ghost = second & marks[out]
    stood = np.where(marks[out], run.sensing.ends[np.where(ghost, 1, 0), out], out)
    nest = tuple(
        run.sensing.second[row] if other else run.nest[row]
        for row, other in zip(out, ghost, strict=True)
    )
    return Blocks(out, stood.astype(np.intp), second & ~ghost, ghost, nest)


def kind_words(kind: int, turn: bool) -> str:
    """Name of a kind in reports; a pose's two blocks have names of their own."""
    if kind == POSE:
        return "pose attitude" if turn else "pose place"
    return KINDS[kind]
