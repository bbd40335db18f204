"""What a machine file describes, found by looking: freedoms, constraints, reach, limits.

Faults are found by :mod:`calib.mechanism.check` when the file is loaded; this says what a sound
machine is like.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.analysis.identifiability import exact_rank
from calib.arrays import Array
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.limits import violations
from calib.mechanism.solve import home_configuration
from calib.mechanism.survey import closure_at, unit_rows
from calib.mechanism.task import task_rows
from calib.poses.reach import PoseSet, reachable, rounded, solve_poses, workspace_box

DRAWN = 600
"""Poses of the workspace box at which reach is judged."""


@dataclass(frozen=True)
class Stop:
    """A limit that keeps poses out of reach, and the part of all drawn poses that it stops."""

    what: str
    part: float


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found.

    Attributes
    ----------
    home_gap_mm, home_gap_rad : float
        From the stated home pose to where the machine closes at its home actuators.
    constraints, redundant : int
        Wrenches of all limbs, and how many more they are than what holds the platform.
    freedoms_held : int
        Rank of the constraints at home, all actuators held: 6 for a sound machine.
    mobility : int
        Independent motions of the platform that the actuators make at home.
    stiffness_home, stiffness_least : float
        Smallest over largest singular value of the closure's rows, at home and over the workspace.
    reach : float
        Part of the workspace box that can be reached.
    box : mapping
        Task coordinate -> range that is reached, the others being anywhere in the box.
    stops : tuple of Stop
        What the rest is stopped by, most frequent first.
    used : mapping
        Actuator or joint -> range that the reachable workspace uses, mm or rad.
    rank : int
        Independent combinations of parameters that whole poses show.
    """

    machine: Machine
    home_gap_mm: float
    home_gap_rad: float
    constraints: int
    redundant: int
    freedoms_held: int
    mobility: int
    stiffness_home: float
    stiffness_least: float
    reach: float
    box: Mapping[str, tuple[float, float]]
    stops: tuple[Stop, ...]
    used: Mapping[str, tuple[float, float]]
    rank: int


def inspect(machine: Machine, generator: np.random.Generator) -> Inspection:
    """Look at a sound machine: at home, and at poses drawn in its workspace."""
    home = home_configuration(machine)
    rows = unit_rows(closure_at(machine, home))[0]
    values = np.linalg.svd(rows, compute_uv=False)
    moves = pose_jacobians(machine, home).actuators[:, :, 0]
    stated = np.array(machine.home)
    low, high = workspace_box(machine)
    unit = generator.random((len(low), DRAWN))
    drawn = solve_poses(machine, rounded(machine, low[:, None] + (high - low)[:, None] * unit))
    inside = reachable(machine, drawn.configuration)
    good = drawn.take(inside)
    held = compile_machine(machine)
    turned = home.poses.to_xyz_rpy()[3:, 0] - stated[3:]
    return Inspection(
        machine=machine,
        home_gap_mm=float(np.linalg.norm(home.poses.position[:, 0] - stated[:3])),
        home_gap_rad=float(np.linalg.norm((turned + np.pi) % (2.0 * np.pi) - np.pi)),
        constraints=held.wrenches,
        redundant=held.wrenches - 6,
        freedoms_held=exact_rank(rows.T),
        mobility=exact_rank(_task_moves(machine, moves, home.poses.rotation)),
        stiffness_home=float(values[-1] / values[0]),
        stiffness_least=_least_stiffness(good),
        reach=float(np.mean(inside)),
        box={
            name: (float(good.task[i].min()), float(good.task[i].max()))
            for i, name in enumerate(machine.task.coordinates)
            if good.count
        },
        stops=_stops(drawn),
        used=_used(good),
        rank=_parameter_rank(good),
    )


def _task_moves(machine: Machine, moves: Array, rotation: Array) -> Array:
    """What the actuators do to the commanded coordinates, columns of equal length."""
    answer = task_rows(machine.task, rotation)[:, :, 0] @ moves.T
    norms = np.linalg.norm(answer, axis=0)
    scaled: Array = answer / np.where(norms > 0.0, norms, 1.0)
    return scaled


def _least_stiffness(good: PoseSet) -> float:
    if not good.count:
        return 0.0
    values = np.linalg.svd(
        unit_rows(closure_at(good.machine, good.configuration)), compute_uv=False
    )
    return float(np.min(values[:, -1] / values[:, 0]))


def _stops(drawn: PoseSet) -> tuple[Stop, ...]:
    found = violations(drawn.machine, drawn.configuration)
    counted = Counter(what for _, what in {(v.pose, v.what) for v in found})
    return tuple(Stop(what, n / drawn.count) for what, n in counted.most_common())


def _used(good: PoseSet) -> dict[str, tuple[float, float]]:
    machine, out = good.machine, {}
    if not good.count:
        return {}
    for actuator, q in zip(machine.actuators, good.q, strict=True):
        out[actuator.name] = (float(q.min()), float(q.max()))
    names = [f"{limb.name}.{joint.name}" for limb in machine.limbs for joint in limb.joints]
    for name, value in zip(names, good.configuration.passive, strict=True):
        out[name] = (float(value.min()), float(value.max()))
    return out


def _parameter_rank(good: PoseSet) -> int:
    if not good.count:
        return 0
    J = pose_jacobians(good.machine, good.configuration).parameters
    J[:, 3:] *= good.machine.size
    flat = (J * good.machine.prior_sigma[:, None, None]).reshape(len(J), -1).T
    norms = np.linalg.norm(flat, axis=0)
    return exact_rank(flat / np.where(norms > 0.0, norms, 1.0))
