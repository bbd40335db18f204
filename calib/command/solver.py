"""Commands that bring the platform where it is wanted: Newton on the machine as it really stands.

With y the wanted task coordinates, f(s) the platform's pose at the commands s (``standing``) and
D = df/ds of the geometry alone, each pass asks the effects once and takes

    s <- s + (T D)^-1 (y - f(s)) - d,     T the task's rows,

with d what the effects have changed the extensions by since the pass before. What D leaves out is
the slope of the effects by s, some hundredths at most, so every pass wins two digits or more.
Commands of a sequence are solved together: each looks back on those before it as they come out, so
all that remembers agrees with what is commanded in the end.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.command.history import History
from calib.command.identified import Identified
from calib.command.standing import (
    AGREED,
    Standpoint,
    command_rows,
    one_pass,
    without_effects,
)
from calib.command.surroundings import Surroundings
from calib.errors import BadInput
from calib.mechanism.configuration import Configuration
from calib.mechanism.limits import violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import begun_at, forward, inverse
from calib.mechanism.task import FULL, task_error, task_rows, task_values

PATIENCE = 40
"""Passes without one more command of a sequence solved, after which the rest is given up."""

STEEPEST = 0.1
"""Growth of what effects add, per unit of way, beyond which it is a jump and no trend."""

UNREACHABLE = "it cannot be reached: the limbs do not close"
BEHIND = "it comes after a pose that does not converge"
STUCK = "it does not converge: no command near it makes up for all effects of the model"


@dataclass(frozen=True, eq=False)
class Commands:
    """What to command for N wanted poses.

    Attributes
    ----------
    wanted : (k, N)
        Task coordinates, mm and rad.
    extension, q : (n, N)
        Commanded extensions, and coordinates by the controller's own parameters; mm or rad. nan
        where ``refused`` says why.
    poses : Poses
        Where the machine then stands, by its model.
    miss : (N,)
        What is left to the wanted task coordinates, as a part of the machine's size (rad of turns).
    passes : int
        Passes taken for all together.
    refused : tuple of str, length N
        Why a pose is not commanded; empty where it is. Those are not on the way of the others.
    history : History
        What was commanded, these included in their order; of alternatives that of before.
    plain : (n, N)
        Extensions by the geometry alone, mm or rad.
    trend : (n, 1)
        How what is added to it grew with it up to the last command; zero where that jumped.
    """

    wanted: Array
    extension: Array
    q: Array
    poses: Poses
    miss: Array
    passes: int
    refused: tuple[str, ...]
    history: History
    standing: Standpoint
    plain: Array
    trend: Array

    @property
    def solved(self) -> BoolArray:
        """Which poses can be commanded, (N,)."""
        return np.array([not why for why in self.refused], dtype=bool)


def commands_for(
    identified: Identified,
    wanted: Poses | Array,
    surroundings: Surroundings | None = None,
    history: History | None = None,
    *,
    start: Configuration | None = None,
    alternatives: bool = False,
    after: Commands | None = None,
) -> Commands:
    """Commands with which the machine, all its effects in it, takes the wanted poses.

    Parameters
    ----------
    identified : Identified
    wanted : Poses, or (k, N)
        Task coordinates in the order of ``machine.task``, mm and rad.
    surroundings : Surroundings, optional
        Load, temperatures, times, and what else the effects depend on.
    history : History, optional
        What was commanded before; a machine at home if not given.
    start : Configuration of N poses or of one, optional
        Where the geometry begins: ``commands.standing.closed`` of a pose nearby.
    alternatives : bool
        Whether each pose is the next after the history, instead of all one after the other.
    after : Commands, optional
        The commands before, of poses nearby: their last one is where these begin, effects and all.
        It saves passes, and steps that are smaller than what an effect makes of them (lost motion)
        keep their direction.

    Returns
    -------
    Commands
        A pose that cannot be reached, passes a limit or does not settle is refused in words and
        left out of the way of those after it; after one that does not settle all are refused.

    Raises
    ------
    BadInput
        For coordinates that are no finite numbers, and if something is not told on which an
        effect depends.
    """
    machine = identified.machine
    goal = task_values(machine.task, wanted) if isinstance(wanted, Poses) else np.asarray(wanted)
    _check(machine.task.coordinates, goal)
    surroundings, history = surroundings or Surroundings(), history or History.at_home(machine)
    after = after if after is not None and after.solved[-1:].all() else None
    if after is not None and start is None:
        closed = after.standing.closed
        start = begun_at(machine, closed.take(slice(closed.count - 1, closed.count)))
    plain = inverse(machine, goal, identified.parameters, start)
    if after is not None and not plain.converged.all():
        plain = inverse(machine, goal, identified.parameters)
    refused = _by_geometry(plain)
    while True:
        steps = _steps(refused, alternatives)
        attempt = _solved(identified, goal, surroundings, history, steps, plain, refused, after)
        if attempt.refused == refused:
            break
        refused = attempt.refused
    if alternatives:
        return replace(attempt, history=history)
    return attempt


def pose_commands(identified: Identified, commands: Commands) -> Poses:
    """Poses to tell a controller that computes with its own parameters.

    Its inverse kinematics of such a pose are the actuator coordinates of ``commands``. A pose that
    was refused stays nan.
    """
    machine = identified.machine
    held = machine.vector(
        {k: v for k, v in identified.controller.items() if k in machine.parameter_index}
    )
    solved = commands.solved
    found = forward(machine, np.where(solved, commands.extension, 0.0), held)
    good = solved & found.converged
    return Poses(
        np.where(good, found.poses.position, np.nan), np.where(good, found.poses.rotation, np.nan)
    )


def _check(coordinates: tuple[str, ...], goal: Array) -> None:
    if goal.ndim != 2 or goal.shape[0] != len(coordinates):
        raise BadInput(
            f"poses of the shape {goal.shape} are no ({len(coordinates)}, N)",
            remedy=f"Give {', '.join(coordinates)}",
        )
    if not np.isfinite(goal).all():
        pose = int(np.argmax(~np.isfinite(goal).all(axis=0)))
        raise BadInput(f"pose {pose + 1} is not finite", remedy="Give numbers in mm and rad")


def _by_geometry(plain: Configuration) -> tuple[str, ...]:
    return tuple("" if good else UNREACHABLE for good in plain.converged)


def _steps(refused: tuple[str, ...], alternatives: bool) -> IntArray:
    """The command that each follows, those that are refused left out; -1 for the history."""
    steps = np.full(len(refused), -1, dtype=np.intp)
    last = -1
    for row, why in enumerate(refused):
        steps[row] = -1 if alternatives else last
        if not why:
            last = row
    return steps


def _solved(
    identified: Identified,
    goal: Array,
    surroundings: Surroundings,
    history: History,
    steps: IntArray,
    plain: Configuration,
    refused: tuple[str, ...],
    after: Commands | None,
) -> Commands:
    """One attempt at all poses that are not refused yet."""
    kept = np.array([not why for why in refused], dtype=bool)
    begin, near = plain.extension, None
    if after is not None:
        grown = after.trend * (plain.extension - after.plain[:, -1:])
        begin = begin + (after.extension - after.plain)[:, -1:] + grown
        near = after.standing.last(kept.size).growing(-grown)
    extension = np.where(kept, begin, history.extension[:, -1:])
    passes = best = waited = 0
    while True:
        if identified.effects:
            rows = command_rows(identified, extension, surroundings, history, steps)
            near = one_pass(identified, rows, near, plain)
        else:
            near = without_effects(
                identified, extension, surroundings, history, steps, near.closed if near else plain
            )
        error = _error(identified, goal, near)
        miss = _size(identified, error)
        good = near.agreed & (miss <= AGREED) | ~kept
        passes += 1
        done = int(good.sum()) if np.all(steps < 0) else int(np.logical_and.accumulate(good).sum())
        waited = 0 if done > best else waited + 1
        best = max(best, done)
        if good.all() or waited > PATIENCE:
            break
        step = _towards(identified, error, near) - near.drift
        if after is not None:  # what effects add grows with it as it did
            near = near.growing(-after.trend * np.where(np.isfinite(step), step, 0.0))
            step = (1.0 + after.trend) * step
        moved = extension + np.where(kept, step, 0.0)
        extension = np.where(np.isfinite(moved), moved, extension)
    why = _why(identified, near, refused, good, steps)
    solved = np.array([not one for one in why], dtype=bool)
    extension = np.where(solved, extension, np.nan)
    times = surroundings.times(goal.shape[1])
    q = identified.machine.coordinates(extension, identified.controller)
    told = History(
        np.concatenate([history.extension, extension[:, solved]], axis=1),
        np.concatenate([history.time_s, times[solved]]),
    )
    trend = _trend(identified, extension, plain.extension, after)
    return Commands(
        goal, extension, q, near.poses, miss, passes, why, told, near, plain.extension, trend
    )


def _trend(identified: Identified, extension: Array, plain: Array, after: Commands | None) -> Array:
    """:attr:`Commands.trend` by the last two commands, those before included."""
    if after is not None and plain.shape[1] == 1:
        extension = np.concatenate([after.extension[:, -1:], extension], axis=1)
        plain = np.concatenate([after.plain[:, -1:], plain], axis=1)
    if plain.shape[1] < 2:
        return np.zeros((plain.shape[0], 1))
    way = plain[:, -1] - plain[:, -2]
    grown = extension[:, -1] - extension[:, -2] - way
    with np.errstate(invalid="ignore"):
        smooth = (np.abs(way) > identified.motion) & (np.abs(grown) <= STEEPEST * np.abs(way))
        return np.asarray(np.where(smooth, grown / np.where(smooth, way, 1.0), 0.0)[:, None])


def _error(identified: Identified, goal: Array, near: Standpoint) -> Array:
    """What is left to the wanted task coordinates, (k, N)."""
    task = identified.machine.task
    return np.asarray(task_error(task, goal, near.poses.position, near.poses.rotation))


def _size(identified: Identified, error: Array) -> Array:
    """Largest of it, lengths as parts of the machine's size, (N,)."""
    machine = identified.machine
    unit = np.array([machine.size if name in "xyz" else 1.0 for name in machine.task.coordinates])
    return np.asarray(np.max(np.abs(error) / unit[:, None], axis=0))


def _towards(identified: Identified, error: Array, near: Standpoint) -> Array:
    """Step (n, N) of the commands that takes the error away by the geometry alone."""
    task = identified.machine.task
    if task.coordinates == FULL:
        slope = near.twists.transpose(2, 1, 0)
    else:
        slope = np.einsum("tcn,acn->nta", task_rows(task, near.poses.rotation), near.twists)
    finite = np.asarray(np.isfinite(slope).all(axis=(1, 2)) & np.isfinite(error).all(axis=0))
    slope = np.where(finite[:, None, None], slope, np.eye(*slope.shape[1:]))
    wanted = np.where(finite, error, 0.0)
    if slope.shape[1] == slope.shape[2]:
        try:
            return np.asarray(np.linalg.solve(slope, wanted.T[:, :, None])[:, :, 0].T)
        except np.linalg.LinAlgError:
            pass  # singular to the last digit: the smallest step will do
    return np.asarray(np.einsum("nat,tn->an", np.linalg.pinv(slope), wanted))


def _why(
    identified: Identified,
    near: Standpoint,
    refused: tuple[str, ...],
    good: BoolArray,
    steps: IntArray,
) -> tuple[str, ...]:
    """Why poses are not commanded; where a sequence got stuck, nothing after it is."""
    why = list(refused)
    if not good.all():
        stuck = np.flatnonzero(~good)
        for row in stuck:
            why[row] = STUCK if near.closed.converged[row] else UNREACHABLE
        if not np.all(steps < 0):
            after = range(stuck[0] + 1, good.size)
            why[stuck[0] + 1 :] = [why[row] if refused[row] else BEHIND for row in after]
        return tuple(why)
    machine, controller = identified.machine, identified.controller
    commanded = replace(near.closed, extension=near.extension)
    for one in violations(machine, commanded, controller):
        if not why[one.pose]:
            why[one.pose] = (
                f"it passes a limit: {one.what} = {one.value:.6g} {one.unit}, "
                f"and {one.low:.6g} to {one.high:.6g} are allowed"
            )
    return tuple(why)
