"""What the hexapod does at every row of a campaign."""

from collections.abc import Mapping

import numpy as np

from calib.mechanism.description import Machine
from mocks.physics.extension import Circumstances, LegErrors, play_widths
from mocks.physics.hexapod import LEGS, geometry, home_pose, legs
from mocks.physics.play import follow
from mocks.physics.pose import Array, Pose, rotations_from_rpy
from mocks.physics.truth import nominal_parameters
from mocks.simulate.layout import HOME, Layout
from mocks.simulate.plan import RunPlan
from mocks.world import home_twist, solve_pose, true_geometry

SMALLEST_STEP_MM = 1e-4
DRAWN_AT_ONCE = 4


def as_poses(poses: Array) -> Pose:
    """Poses from (N, 6): x, y, z in mm, rx, ry, rz in rad."""
    return Pose(np.asarray(poses[:, :3], dtype=float), rotations_from_rpy(poses[:, 3:]))


def controller_parameters(machine: Machine, given: Mapping[str, float]) -> dict[str, float]:
    """All parameters that the controller uses; raises ValueError for an unknown name."""
    held = nominal_parameters(machine)
    unknown = set(given) - set(held)
    if unknown:
        raise ValueError(f"machine {machine.name} has no parameter {sorted(unknown)[0]}")
    return {**held, **given}


def commanded_lengths(held: Mapping[str, float], poses: Array) -> Array:
    """Leg lengths that a controller with parameters ``held`` computes for poses, (N, 6), mm."""
    return legs(geometry(held), as_poses(poses)).length


def random_poses(machine: Machine, held: Mapping[str, float], plan: RunPlan, count: int) -> Array:
    """``count`` reachable poses drawn from the machine's workspace box, (count, 6)."""
    rng = plan.rng(0)
    box = np.array([machine.workspace[name] for name in ("x", "y", "z", "rx", "ry", "rz")])
    low, high = machine.q_limits.T
    found = np.empty((0, 6))
    while len(found) < count:
        tried = rng.uniform(box[:, 0], box[:, 1], (DRAWN_AT_ONCE * count, 6))
        q = commanded_lengths(held, tried)
        inside = np.all((q >= low) & (q <= high), axis=1)
        found = np.vstack([found, tried[inside]])
    return found[:count]


def commanded_q(held: Mapping[str, float], poses: Array, rows: Layout) -> Array:
    """Commanded actuator coordinates of every row, (R, 6), mm: home is s = 0."""
    home = np.array([held[f"leg{i + 1}.L0"] for i in range(LEGS)])
    q = np.vstack([commanded_lengths(held, poses), home])
    assert HOME == -1, "home is the last row"
    return np.round(q[rows.pose], 6)


def true_poses(
    parameters: Mapping[str, float], plan: RunPlan, extension: Array, channels: Mapping[str, Array]
) -> Pose:
    """Where the platform really is at every row.

    ``extension`` (R, 6) mm as commanded; ``channels`` (R,): ``structure_temp_C``,
    ``air_temp_C``, ``payload_kg``, ``delay_s``.
    """
    widths = play_widths(plan.hidden)
    play = np.zeros((*extension.shape, widths.shape[1]))
    if plan.hidden.has("backlash.") or plan.hidden.has("unknown.hysteresis."):
        play = follow(extension, widths)
    circumstances = Circumstances(
        extension=extension,
        play=play,
        step=_last_step(extension),
        delay=np.repeat(channels["delay_s"][:, None], LEGS, axis=1),
        structure=channels["structure_temp_C"],
        air=channels["air_temp_C"],
        payload=channels["payload_kg"],
    )
    g = true_geometry(parameters, plan.hidden)
    errors = LegErrors(plan.hidden, plan.load, settles=False)
    return solve_pose(g, errors, circumstances, home_twist(g), home_pose(len(extension)))


def _last_step(extension: Array) -> Array:
    """Last change of each leg up to every row that was one, (R, 6), mm; 0 before the first."""
    change = np.diff(extension, axis=0, prepend=extension[:1])
    rows = np.arange(len(extension))[:, None]
    last = np.maximum.accumulate(np.where(np.abs(change) > SMALLEST_STEP_MM, rows, 0), axis=0)
    return np.asarray(np.take_along_axis(change, last, axis=0))
