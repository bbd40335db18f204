"""Distances and tilts at poses, poses at which a gauge is in range, pairs of marks to measure.

The zero of a gauge and the place of a plate are taken as known: three to five unknowns beside the
machine's, which a campaign of some dozen readings determines with the rest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.errors import BadInput
from calib.mechanism.configuration import joined
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.mechanism.rigid import Poses, cross, rotate
from calib.mechanism.task import task_values
from calib.poses.choose import Candidates, exchange, greedy
from calib.poses.design import LEVER, Design
from calib.poses.information import Judge, prior, whitened_rows
from calib.poses.reach import DRAWS, PoseSet, reachable, rounded, sample_poses, solve_poses
from calib.poses.readings import PoseNoise, Readings, pose_root

PLACE = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class DistanceReadings:
    """Distances from nests of the platform to nests of the base, where they are in range.

    Attributes
    ----------
    ends : (3, K), (3, K)
        Pair by pair: platform frame and base frame, mm.
    sigma : float
        Standard uncertainty of a distance, mm.
    span : (float, float)
        Shortest and longest distance that can be read, mm.
    """

    ends: tuple[Array, Array]
    sigma: float
    span: tuple[float, float] = (0.0, np.inf)

    @property
    def says(self) -> str:
        """What is read, in words."""
        low, high = self.span
        bound = f", {low:g} to {high:g} mm" if np.isfinite(high) or low > 0.0 else ""
        return (
            f"distances of {self.ends[0].shape[1]} pairs of nests{bound}, "
            f"+-{self.sigma * 1e3:.3g} um (1 sigma), the zero taken as known"
        )

    @property
    def frame_free(self) -> bool:
        """The nests of the base are known in its frame."""
        return False

    def root(self, poses: Poses) -> Array:
        """Root (6, 6, N) of the sum over pairs in range of r^T r / sigma^2, r = [u, R m x u]."""
        rows = []
        for nest, far in zip(self.ends[0].T, self.ends[1].T, strict=True):
            arm = rotate(poses.rotation, nest[:, None])
            apart = poses.position + arm - far[:, None]
            length = np.linalg.norm(apart, axis=0)
            u = apart / np.maximum(length, 1e-9)
            here = (length >= self.span[0]) & (length <= self.span[1])
            rows.append(np.concatenate([u, cross(arm, u)]) * here)
        return pose_root(np.array(rows) / self.sigma)

    def frame_information(self) -> Array:
        """Nothing is asked about the frame."""
        return np.zeros((6, 6))


@dataclass(frozen=True, eq=False)
class TiltReadings:
    """How far an axis of the platform (3,) points above the horizontal; ``up`` (3,); rad."""

    axis: Array
    up: Array
    sigma: float

    @property
    def says(self) -> str:
        """What is read, in words."""
        return f"tilts of an axis of the platform, +-{self.sigma * 1e3:.3g} mrad (1 sigma)"

    @property
    def frame_free(self) -> bool:
        """Gravity is known in the base frame."""
        return False

    def root(self, poses: Poses) -> Array:
        """Root (6, 6, N) of r^T r / sigma^2, r = [0, R a x up / cos]."""
        turned = rotate(poses.rotation, self.axis[:, None])
        cosine = np.sqrt(np.maximum(1.0 - (self.up @ turned) ** 2, 1e-12))
        row = cross(turned, np.repeat(self.up[:, None], poses.count, axis=1)) / cosine
        return pose_root(np.concatenate([np.zeros_like(row), row])[None] / self.sigma)

    def frame_information(self) -> Array:
        """Nothing is asked about the frame."""
        return np.zeros((6, 6))


Bring = Callable[[Poses, np.random.Generator], Array]
"""How far (3, N) each platform is to be moved, mm, base axes, so that the gauge is in range."""


def to_plane(nest: Array, normal: Array, offset: float) -> Bring:
    """A nest (3,), platform frame, onto the plane normal . p = offset."""

    def bring(poses: Poses, generator: np.random.Generator) -> Array:
        at = poses.position + rotate(poses.rotation, nest[:, None])
        return np.asarray(np.outer(normal, offset - normal @ at))

    return bring


def to_span(ends: tuple[Array, Array], span: tuple[float, float]) -> Bring:
    """Each pose to a distance within the span of one of the pairs, in turn."""

    def bring(poses: Poses, generator: np.random.Generator) -> Array:
        pair = np.arange(poses.count) % ends[0].shape[1]
        arm = np.einsum("ijn,jn->in", poses.rotation, ends[0][:, pair])
        apart = poses.position + arm - ends[1][:, pair]
        length = np.linalg.norm(apart, axis=0)
        inner = 0.05 * (span[1] - span[0])
        wanted = generator.uniform(span[0] + inner, span[1] - inner, poses.count)
        return np.asarray(apart / np.maximum(length, 1e-9) * (wanted - length))

    return bring


def gauge_poses(
    machine: Machine,
    bring: Bring | None,
    lifts: Sequence[Array],
    *,
    margin: Margin | None = None,
    shows: Callable[[Poses], BoolArray] | None = None,
) -> Callable[[int, np.random.Generator], PoseSet]:
    """How poses are drawn at which a gauge is in range, and from which it can be lifted.

    ``lifts``, (3,) each, are how far the platform moves to let go, and as deep as it is lowered,
    mm, base frame; ``shows`` is whether the gauge is in range, where the machine cannot move as it
    is to be brought.

    Raises
    ------
    BadInput
        When drawing, if hardly any can be reached.
    """
    moves = set(PLACE) <= set(machine.task.coordinates)

    def draw(count: int, generator: np.random.Generator) -> PoseSet:
        kept: list[PoseSet] = []
        have = drawn = 0
        for _ in range(DRAWS):
            found = sample_poses(machine, count, generator, margin)
            drawn += count
            if moves and bring is not None:
                found = _moved(found, bring(found.poses, generator))
                found = found.take(_inside(found) & reachable(machine, found.configuration, margin))
            if not moves and shows is not None:
                found = found.take(shows(found.poses))
            for lift in lifts if moves else ():
                up = _moved(found, np.repeat(lift[:, None], found.count, axis=1))
                found = found.take(reachable(machine, up.configuration, margin))
            kept.append(found)
            have += found.count
            if have >= count:
                task = np.concatenate([one.task for one in kept], axis=1)
                return PoseSet(machine, task, joined([p.configuration for p in kept])).take(
                    slice(0, count)
                )
        raise BadInput(
            f"only {have} of {drawn} poses bring the gauge into its range and let it be lifted",
            place=machine.source,
            remedy="See where plane or nests are, zero_at, lowest, highest, clearance_mm, below_mm",
        )

    return draw


def _inside(found: PoseSet) -> BoolArray:
    """Whether poses are within the workspace box."""
    box = np.array([found.machine.workspace[name] for name in found.machine.task.coordinates])
    low, high = box.T[:, :, None]
    return np.asarray(np.all((found.task >= low - 1e-6) & (found.task <= high + 1e-6), axis=0))


def _moved(found: PoseSet, by: Array) -> PoseSet:
    """Platforms moved by (3, N), base axes."""
    machine = found.machine
    moved = Poses(found.poses.position + by, found.poses.rotation)
    return solve_poses(machine, rounded(machine, task_values(machine.task, moved)))


@dataclass(frozen=True)
class MarkPairs:
    """Pairs of poses whose marks tell most, and what is predicted with them measured as well."""

    pairs: tuple[tuple[str, str], ...]
    position_um: float
    orientation_mdeg: float


def choose_marks(
    design: Design, readings: Readings, count: int, nest: Array, sigma: float
) -> MarkPairs:
    """Choose pairs of a design's poses to be measured with calipers between marks.

    Parameters
    ----------
    design : Design
    readings : Readings
        What else is read at these poses.
    count : int
    nest : (3,)
        What leaves the marks, platform frame, mm.
    sigma : float
        Standard uncertainty of a distance, mm.

    Raises
    ------
    BadInput
        If there are fewer pairs.
    """
    poses = design.pose_set
    first, second = np.triu_indices(poses.count, 1)
    if count > first.size:
        raise BadInput(
            f"{count} distances of {first.size} pairs", remedy="Ask for fewer, or for more poses."
        )
    known = prior(poses, readings, priors=design.priors)
    rows = whitened_rows(poses, readings, known.scale)
    base = known.information + np.einsum("prn,qrn->pq", rows, rows)
    twists = whitened_rows(
        poses, PoseNoise(1.0, 1.0), known.scale[: len(poses.machine.prior_sigma)]
    )
    arm = rotate(poses.poses.rotation, nest[:, None])
    tip = poses.poses.position + arm
    apart = tip[:, first] - tip[:, second]
    u = apart / np.maximum(np.linalg.norm(apart, axis=0), 1e-9)

    def along(which: IntArray) -> Array:
        wrench = np.concatenate([u, cross(arm[:, which], u)])
        return np.asarray(np.einsum("prn,rn->pn", twists[:, :, which], wrench))

    pair_rows = np.zeros((len(known.scale), 1, first.size))
    pair_rows[: twists.shape[0], 0] = (along(first) - along(second)) / sigma
    judge = Judge.over(poses, readings, known.scale)
    candidates = Candidates(pair_rows, base, judge.weight(LEVER), design.criterion)
    greedy(candidates, count, spread_first=False)
    exchange(candidates, count)
    candidates.refresh()
    found = judge.accuracy(candidates.C)
    pairs = tuple((design.labels[first[k]], design.labels[second[k]]) for k in candidates.chosen)
    return MarkPairs(tuple(sorted(pairs)), found.position_um, found.orientation_mdeg)
