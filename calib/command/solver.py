"""Commands that bring the platform where it is wanted: the inverse, less what the effects add.

Where the platform is wanted is where the machine has to close, but for what effects do to the
platform itself (``aiming``): E, the extensions there. What the effects change, d, depends on where
the machine stands, which is known, and on the commands s themselves, weakly. Each pass asks the
effects once and takes

    s <- E - d,

so every pass wins two digits or more. Commands of a sequence are solved together: each looks back
on those before it as they come out, so all that remembers agrees with what is commanded in the end.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.command.aiming import Aim
from calib.command.changes import AGREED, Changes, changes_at, unrest
from calib.command.course import Course
from calib.command.easing import STEEPEST
from calib.command.history import History
from calib.command.identified import Identified
from calib.command.standing import Standpoint
from calib.command.surroundings import Surroundings
from calib.command.told import Told
from calib.errors import BadInput
from calib.mechanism.configuration import Configuration
from calib.mechanism.limits import passes_none, violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import begun_at, forward, home_configuration, inverse
from calib.mechanism.task import task_values

PATIENCE = 40
"""Passes without one more command of a sequence solved, after which the rest is given up."""

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
    passes : int
        Passes taken for all together.
    refused : tuple of str, length N
        Why a pose is not commanded; empty where it is. Those are not on the way of the others.
    history : History
        What was commanded, these included in their order; of alternatives that of before.
    standing : Standpoint
        Where the machine then stands, by its model.
    plain : (n, N)
        Extensions by the geometry alone, mm or rad.
    course : Course
        How what the effects change went on from command to command.
    motion : (n, 1)
        Changes of extensions up to this are rounding.
    before : (n, 1), (n, 1) or None
        ``extension`` and ``plain`` of the command before the first; None where none is nearby.
    """

    wanted: Array
    extension: Array
    q: Array
    passes: int
    refused: tuple[str, ...]
    history: History
    standing: Standpoint
    plain: Array
    course: Course
    motion: Array
    before: tuple[Array, Array] | None

    @property
    def poses(self) -> Poses:
        """Where the machine then stands, by its model."""
        return self.standing.poses

    @cached_property
    def trend(self) -> Array:
        """How what is added to ``plain`` grew with it up to the last command, (n, 1).

        Zero where that jumped.
        """
        if self.plain.shape[1] > 1:
            last, begun = self.extension[:, -2:-1], self.plain[:, -2:-1]
        elif self.before is not None:
            last, begun = self.before
        else:
            return np.zeros_like(self.plain)
        way = self.plain[:, -1:] - begun
        grown = self.extension[:, -1:] - last - way
        length = np.abs(way)
        smooth = (length > self.motion) & (np.abs(grown) <= STEEPEST * length)
        way[~smooth] = 1.0
        return np.asarray(np.where(smooth, grown / way, 0.0))

    @cached_property
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
        start = after.standing.closed
        start = start if start.count == 1 else start.take(slice(start.count - 1, start.count))
        start = start if identified.closing is machine else begun_at(machine, start)
    plain = inverse(machine, goal, identified.parameters, start)
    if after is not None and not plain.converged.all():
        plain = inverse(machine, goal, identified.parameters)
    refused, reachable = ("",) * goal.shape[1], goal
    if not plain.converged.all():  # the others are solved beside a pose that can be
        refused = tuple("" if good else UNREACHABLE for good in plain.converged)
        home = task_values(machine.task, home_configuration(machine).poses)
        reachable = np.where(plain.converged, goal, home)
        plain = inverse(machine, reachable, identified.parameters)
    while True:
        steps = _steps(refused, alternatives)
        told = Told.of(identified, surroundings, history, steps)
        attempt = _solved(told, reachable, history, plain, refused, after)
        if attempt.refused == refused:
            break
        refused = attempt.refused
    if reachable is not goal or alternatives:
        kept = history if alternatives else attempt.history
        return replace(attempt, wanted=goal, history=kept)
    return attempt


def pose_commands(identified: Identified, commands: Commands) -> Poses:
    """Poses to tell a controller that computes with its own parameters.

    Its inverse kinematics of such a pose are the actuator coordinates of ``commands``. A pose that
    was refused stays nan.
    """
    machine = identified.machine
    solved = commands.solved
    held = identified.held_by_controller
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
    told: Told,
    goal: Array,
    history: History,
    plain: Configuration,
    refused: tuple[str, ...],
    after: Commands | None,
) -> Commands:
    """One attempt at all poses that are not refused yet."""
    identified, count = told.identified, goal.shape[1]
    kept = np.array([not why for why in refused], dtype=bool)
    after = after if identified.effects else None
    before = None if after is None else _foreseen(identified, plain, after)
    aim = Aim.at(identified, goal, plain, before)
    begin = aim.closed.extension if before is None else aim.closed.extension - before.extension
    extension = np.where(kept, begin, history.extension[:, -1:])
    if identified.effects:
        near, good, passes = _settled(told, aim, extension, before, kept, after)
    else:
        none = Changes(np.zeros_like(extension), None, None)
        near = aim.standing(extension, np.zeros(count), none)
        good, passes = plain.converged | ~kept, 1
    why = _why(identified, near, refused, good, told.alternatives)
    solved = np.array([not one for one in why], dtype=bool)
    extension = np.where(solved, near.extension, np.nan)
    q = extension + identified.reference
    sent = History(
        np.concatenate([history.extension, extension[:, solved]], axis=1),
        np.concatenate([history.time_s, told.time_s[solved]]),
    )
    course = Course.after(near.changes, None if after is None else after.course)
    last = None if after is None else (after.extension[:, -1:], after.plain[:, -1:])
    return Commands(
        wanted=goal,
        extension=extension,
        q=q,
        passes=passes,
        refused=why,
        history=sent,
        standing=near,
        plain=plain.extension,
        course=course,
        motion=identified.motion[:, None],
        before=last,
    )


def _foreseen(identified: Identified, plain: Configuration, after: Commands) -> Changes:
    """What the effects are taken to change at first, by what they did before."""
    if plain.count == 1:
        return after.course.next(identified.motion[:, None])
    grown = after.trend * (plain.extension - after.plain[:, -1:])
    return after.standing.changes.last(plain.count).growing(-grown)


def _settled(
    told: Told,
    aim: Aim,
    extension: Array,
    before: Changes | None,
    kept: BoolArray,
    after: Commands | None,
) -> tuple[Standpoint, BoolArray, int]:
    """Ask effects and take what they say off, until they say the same; which did, passes taken."""
    identified = told.identified
    passes = best = waited = 0
    while True:
        changes = changes_at(identified, aim.situation(told.rows(extension)))
        moved = unrest(identified, changes, before)
        good = aim.closed.converged & (moved <= AGREED) | ~kept
        passes += 1
        ready = good if told.alternatives else np.logical_and.accumulate(good)
        done = int(np.count_nonzero(ready))
        waited = 0 if done > best else waited + 1
        best = max(best, done)
        if done == good.size or waited > PATIENCE:
            return aim.standing(extension, moved, changes), good, passes
        aim = aim.moved(changes)
        step = aim.closed.extension - changes.extension - extension
        step = np.where(kept & np.isfinite(step), step, 0.0)
        before = changes
        if after is not None:  # what effects add grows with it as it did
            before = changes.growing(-after.trend * step)
            step = (1.0 + after.trend) * step
        extension = extension + step


def _why(
    identified: Identified,
    near: Standpoint,
    refused: tuple[str, ...],
    good: BoolArray,
    alternatives: bool,
) -> tuple[str, ...]:
    """Why poses are not commanded; where a sequence got stuck, nothing after it is."""
    why = list(refused)
    if not good.all():
        stuck = np.flatnonzero(~good)
        for row in stuck:
            why[row] = STUCK if near.closed.converged[row] else UNREACHABLE
        if not alternatives:
            after = range(stuck[0] + 1, good.size)
            why[stuck[0] + 1 :] = [why[row] if refused[row] else BEHIND for row in after]
        return tuple(why)
    machine, controller = identified.machine, identified.controller
    if passes_none(machine, near.extension + identified.reference, near.closed):
        return tuple(why)
    commanded = replace(near.closed, extension=near.extension)
    for one in violations(machine, commanded, controller):
        if not why[one.pose]:
            why[one.pose] = (
                f"it passes a limit: {one.what} = {one.value:.6g} {one.unit}, "
                f"and {one.low:.6g} to {one.high:.6g} are allowed"
            )
    return tuple(why)
