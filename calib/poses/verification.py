"""The grid on which a calibration is judged: nodes x orientations, all within reach.

Han et al. 2020 (section "Verification", Table 6) use 27 nodes of a 3 x 3 x 3 box and eight
orientations at each: 216 poses. Their Table 3 is no box in which that is possible, so the box is
shrunk about its centre until every pose is reachable, and what was found is stated.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import home_configuration
from calib.mechanism.task import task_values
from calib.poses.margin import tolerance_margin
from calib.poses.reach import (
    PoseSet,
    reachable,
    rounded,
    sample_poses,
    solve_poses,
    workspace_box,
)

STEPS = 10
"""Halvings of the box's scale: it is found to a thousandth."""
ELSEWHERE = 1.1
"""How much larger the grid must become to leave the middle of the workspace."""
POOR = 0.3
"""Scale above which nobody looks for a better centre."""
SAMPLES, SEED = 200, 1
"""Reachable poses whose mean is tried as a centre; always the same."""
SPARE = 0.02
"""Least part of each stroke kept free at its ends: a calibrated machine needs other q."""


@dataclass(frozen=True, eq=False)
class VerificationGrid:
    """Verification poses and the box that they span.

    Attributes
    ----------
    labels : tuple of str
        ``n01o1`` .. ``n27o8``: node and orientation.
    pose_set : PoseSet
    scale : float
        Part of the machine file's workspace that the grid spans.
    box : mapping
        Task coordinate -> (low, high), mm or rad.
    """

    labels: tuple[str, ...]
    pose_set: PoseSet
    scale: float
    box: Mapping[str, tuple[float, float]]

    @property
    def poses(self) -> Poses:
        """Platform poses (N) in the base frame."""
        return self.pose_set.poses

    @property
    def by_label(self) -> dict[str, tuple[float, float, float, float, float, float]]:
        """Label -> x, y, z (mm), rx, ry, rz (rad), in the order of the path."""
        rows = self.poses.to_xyz_rpy().T
        return {
            label: (float(r[0]), float(r[1]), float(r[2]), float(r[3]), float(r[4]), float(r[5]))
            for label, r in zip(self.labels, rows, strict=True)
        }


def unit_grid(machine: Machine) -> tuple[list[str], Array]:
    """Labels and unit coordinates (n, N) in -1..1 of nodes and orientations.

    Positions get three levels each; angles of a machine that also commands positions get their
    two extremes. A pointing machine gets five tilts and eight azimuths.
    """
    names = machine.task.coordinates
    if machine.task.pointing:
        levels = [
            list(np.linspace(-1.0, 1.0, 5)) if name == "tilt" else list(np.arange(-4, 4) / 4.0)
            for name in names
        ]
        points = list(product(*levels))
        return [f"n{i:02d}" for i in range(1, len(points) + 1)], np.array(points).T
    lengths = [i for i, name in enumerate(names) if name in "xyz"]
    angles = [i for i, name in enumerate(names) if name not in "xyz"]
    if not lengths:
        points = list(product((-1.0, 0.0, 1.0), repeat=len(angles)))
        return [f"n{i:02d}" for i in range(1, len(points) + 1)], np.array(points).T
    labels, columns = [], []
    for node, place in enumerate(_snake(len(lengths)), start=1):
        for corner, turn in enumerate(product((-1.0, 1.0), repeat=len(angles)), start=1):
            column = np.zeros(len(names))
            column[lengths], column[angles] = place, turn
            columns.append(column)
            labels.append(f"n{node:02d}o{corner}" if angles else f"n{node:02d}")
    return labels, np.array(columns).T


def _snake(dimensions: int) -> list[tuple[float, ...]]:
    """Nodes of a three-level grid, each a neighbour of the one before."""
    nodes: list[tuple[float, ...]] = [()]
    for _ in range(dimensions):
        nodes = [
            (*node, level)
            for i, node in enumerate(nodes)
            for level in ((-1.0, 0.0, 1.0) if i % 2 == 0 else (1.0, 0.0, -1.0))
        ]
    return nodes


@lru_cache(maxsize=8)
def verification_poses(machine: Machine) -> VerificationGrid:
    """27 nodes x 8 orientations (216 poses) for a hexapod; fewer coordinates give fewer poses.

    The whole grid is scaled about the centre of the machine file's workspace by the largest
    factor, to a thousandth, at which all poses are reachable. Where the workspace reaches far
    into nothing (a tripod's box), the grid stands around the home pose or around the middle of
    what can be reached instead, if it becomes larger there.

    Raises
    ------
    BadInput
        If not even the centre can be reached.
    """
    low, high = workspace_box(machine)
    labels, unit = unit_grid(machine)
    half = 0.5 * (high - low)
    best, centre = 0.0, 0.5 * (low + high)
    for candidate in _centres(machine):
        room = np.min(np.minimum(candidate - low, high - candidate) / half)
        scale = _largest(machine, candidate, half, unit, float(np.clip(room, 0.0, 1.0)))
        if scale > (ELSEWHERE * best if best else 0.0):
            best, centre = scale, candidate
        if best > POOR:
            break
    if best == 0.0:
        raise BadInput(
            "the centre of the workspace cannot be reached",
            place=machine.source,
            remedy="Move [workspace] to where the machine can go.",
        )
    pose_set = _grid(machine, centre, half, unit, best)
    box = {
        name: (float(pose_set.task[i].min()), float(pose_set.task[i].max()))
        for i, name in enumerate(machine.task.coordinates)
    }
    return VerificationGrid(tuple(labels), pose_set, best, box)


def _centres(machine: Machine) -> Iterator[Array]:
    """Middle of the workspace, home, and the middle of what can be reached."""
    low, high = workspace_box(machine)
    yield 0.5 * (low + high)
    home = home_configuration(machine).poses
    yield np.clip(task_values(machine.task, home)[:, 0], low, high)
    some = sample_poses(machine, SAMPLES, np.random.default_rng(SEED)).task
    yield rounded(machine, some.mean(axis=1)[:, None])[:, 0]


def _grid(machine: Machine, centre: Array, half: Array, unit: Array, scale: float) -> PoseSet:
    return solve_poses(machine, rounded(machine, centre[:, None] + scale * half[:, None] * unit))


def _spared(machine: Machine) -> Margin:
    """What is kept free of limits: what tolerances need, and 2 % of each stroke at least."""
    margin = tolerance_margin(machine)
    least = SPARE * np.diff(machine.q_limits, axis=1)[:, 0]
    return replace(margin, actuators=np.maximum(margin.actuators, least))


def _largest(machine: Machine, centre: Array, half: Array, unit: Array, room: float) -> float:
    """Largest scale up to ``room`` at which the whole grid is reachable; 0 if none is."""
    margin = _spared(machine)

    def fits(scale: float) -> bool:
        found = _grid(machine, centre, half, unit, scale)
        return bool(np.all(reachable(machine, found.configuration, margin)))

    if fits(room):
        return room
    good, bad = 0.0, room
    for _ in range(STEPS):
        between = 0.5 * (good + bad)
        good, bad = (between, bad) if fits(between) else (good, between)
    return float(np.floor(good * 1000.0) / 1000.0)
