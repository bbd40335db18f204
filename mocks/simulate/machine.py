"""What a machine does at every row of a campaign."""

from collections.abc import Mapping

import numpy as np

from calib.mechanism.description import Machine
from mocks.physics.actuators import Load, play_widths, true_load
from mocks.physics.body import Body
from mocks.physics.circumstances import Circumstances
from mocks.physics.play import follow
from mocks.physics.pose import Array, Pose
from mocks.physics.stand import Stand
from mocks.physics.truth import nominal_parameters
from mocks.simulate.layout import HOME, Layout
from mocks.simulate.plan import RunPlan

DRAWN_AT_ONCE = 4
MOST_ROUNDS = 100


def controller_parameters(machine: Machine, given: Mapping[str, float]) -> dict[str, float]:
    """All parameters that the controller uses; raises ValueError for an unknown name."""
    held = nominal_parameters(machine)
    unknown = set(given) - set(held)
    if unknown:
        raise ValueError(f"machine {machine.name} has no parameter {sorted(unknown)[0]}")
    return {**held, **given}


def random_poses(body: Body, held: Mapping[str, float], plan: RunPlan, count: int) -> Array:
    """``count`` reachable poses drawn from the machine's workspace box, (count, k)."""
    rng, machine = plan.rng(0), body.machine
    box = np.array([machine.workspace[name] for name in machine.task.coordinates])
    low, high = machine.q_limits.T
    found = np.empty((0, len(box)))
    for _ in range(MOST_ROUNDS):
        if len(found) >= count:
            return found[:count]
        tried = rng.uniform(box[:, 0], box[:, 1], (DRAWN_AT_ONCE * count, len(box)))
        q = body.commanded(held, tried)
        inside = np.all((q >= low) & (q <= high), axis=1)
        found = np.vstack([found, tried[inside]])
    raise ValueError(
        f"{len(found)} of {MOST_ROUNDS * DRAWN_AT_ONCE * count} poses of the workspace are in reach"
    )


def commanded_q(body: Body, held: Mapping[str, float], poses: Array, rows: Layout) -> Array:
    """Commanded actuator coordinates of every row, (R, n); home as the controller has it."""
    away = body.machine.home_q - body.machine.reference()
    q = np.vstack([body.commanded(held, poses), body.reference(held) + away])
    assert HOME == -1, "home is the last row"
    return np.round(q[rows.pose], body.stroke.digits)


def true_poses(
    body: Body,
    parameters: Mapping[str, float],
    plan: RunPlan,
    load: Load,
    extension: Array,
    time: Array,
    channels: Mapping[str, Array],
) -> Pose:
    """Where the platform really is at every row.

    ``load`` as it is stated; ``extension`` (R, n) as commanded; ``time`` (R,) s; ``channels`` (R,):
    ``structure_temp_C``, ``air_temp_C``, ``payload_kg``, ``delay_s``.
    """
    widths = play_widths(plan.hidden, body.limbs, body.stroke)
    load = true_load(load, plan.hidden, body.limbs, body.stroke)
    circumstances = Circumstances(
        extension=extension,
        play=follow(extension, widths),
        step=_last_step(extension, body.stroke.smallest),
        delay=np.repeat(channels["delay_s"][:, None], extension.shape[1], axis=1),
        structure=channels["structure_temp_C"],
        air=channels["air_temp_C"],
        payload=channels["payload_kg"],
        remembered=lambda tau: _remembered(extension, time, body.stroke.smallest, tau),
        time=time,
    )
    real = body.real(parameters, plan.hidden, load, settles=False)
    pose = real.poses(circumstances, real.home(len(extension)))
    return Stand(plan.hidden, body, load).under(pose, circumstances.payload)


def _last_step(extension: Array, smallest: float) -> Array:
    """Last change of each actuator up to every row that was one, (R, n); 0 before the first."""
    change = _change(extension)
    rows = np.arange(len(extension))[:, None]
    last = np.maximum.accumulate(np.where(np.abs(change) > smallest, rows, 0), axis=0)
    return np.asarray(np.take_along_axis(change, last, axis=0))


def _remembered(extension: Array, time: Array, smallest: float, tau: float) -> Array:
    """What is left of all moves up to every row, each faded by its age, (R, n)."""
    change = _change(extension)
    change[np.abs(change) <= smallest] = 0.0
    kept = np.exp(-np.diff(time, prepend=time[:1]) / tau)
    left = np.zeros_like(change)
    for row in range(1, len(change)):
        left[row] = kept[row] * left[row - 1] + change[row]
    return left


def _change(extension: Array) -> Array:
    """Change since the row before, (R, n); 0 in the first."""
    return np.diff(extension, axis=0, prepend=extension[:1])
