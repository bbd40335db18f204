"""Where the platform really stands at given commands, every machine effect in it.

An effect depends on the pose that it changes, weakly: geometry is closed at the extensions that
the effects of the pass before make of the commands, and the effects are asked again, until both
agree. What an effect does to the platform itself (``Signature.twist``) comes last:
x -> x + v, R -> exp(omega) R.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.command.history import History
from calib.command.identified import Identified
from calib.command.rows import rows_at
from calib.command.surroundings import Surroundings
from calib.effects.component import Signature, Situation
from calib.errors import BadInput
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import Poses, exponential, product
from calib.mechanism.solve import Configuration, begun_at, forward, home_configuration
from calib.runs.stack import Rows

PASSES = 40
AGREED = 1e-10
"""Change from pass to pass, as a part of the machine's size (rad of turns), that is rounding."""


@dataclass(frozen=True, eq=False)
class Standpoint:
    """A machine at N commands.

    Attributes
    ----------
    poses : Poses
        Where the platform is.
    closed : Configuration
        Of the machine that its effects leave, at the extensions that they make of the commands.
    extension : (n, N)
        As commanded, mm or rad.
    unrest : (N,)
        How much the effects changed in the last pass, as a part of the machine's size.
    drift : (n, N)
        How much they changed the extensions in it, mm or rad.
    """

    poses: Poses
    closed: Configuration
    extension: Array
    unrest: Array
    drift: Array
    _done: "_Changes"
    _situated: Callable[[], Situation]

    @cached_property
    def situation(self) -> Situation:
        """What the effects were asked at."""
        return self._situated()

    @property
    def agreed(self) -> BoolArray:
        """Whether the machine closes, and its effects agree with where it stands, (N,)."""
        return self.closed.converged & (self.unrest <= AGREED)

    def last(self, count: int) -> "Standpoint":
        """The last of its commands as where to begin ``count`` others nearby."""
        done = self._done
        parameters = None
        if done.parameters is not None:
            parameters = np.repeat(done.parameters[:, -1:], count, axis=1)
        return replace(
            self,
            closed=self.closed.take(slice(self.closed.count - 1, self.closed.count)),
            _done=_Changes(
                np.repeat(done.extension[:, -1:], count, axis=1),
                parameters,
                np.repeat(done.twist[:, -1:], count, axis=1),
            ),
        )

    def growing(self, extension: Array) -> "Standpoint":
        """The same as where to begin, if the effects change the extensions by (n, N) more."""
        done = self._done
        return replace(self, _done=replace(done, extension=done.extension + extension))

    @property
    def twists(self) -> Array:
        """Derivative (n, 6, N) of the platform's twist by each extension, base axes."""
        return self.situation.actuator_twists


@dataclass(frozen=True, eq=False)
class _Changes:
    """What all effects together change: (n, N), (P, N) or None, (6, N)."""

    extension: Array
    parameters: Array | None
    twist: Array


def command_rows(
    identified: Identified,
    extension: Array,
    surroundings: Surroundings,
    history: History,
    steps: IntArray,
) -> Rows:
    """Rows of N commands (n, N); ``steps`` as for :meth:`History.path`.

    Raises
    ------
    BadInput
        If a channel is missing without which an effect has no value.
    """
    count = extension.shape[1]
    channels = {name: surroundings.channel(name, count) for name in surroundings.channels}
    for name in identified.needs:
        if name not in channels:
            who = next(f.effect.id for f in identified.effects if name in f.needs)
            raise BadInput(
                f"the effect {who} depends on {name}, and that is not told",
                remedy=f"Say what {name} is",
            )
    if identified.needs_time and surroundings.time_s is None:
        who = next(f.effect.id for f in identified.effects if "time_s" in f.effect.depends)
        raise BadInput(
            f"the effect {who} depends on the time, and that is not told", remedy="Say time_s"
        )
    path, at = history.path(extension, surroundings.times(count), identified.motion, steps)
    machine, controller = identified.machine, identified.controller
    return rows_at(machine, identified.run, path, at, channels, controller)


def standpoint(
    identified: Identified,
    extension: Array,
    surroundings: Surroundings | None = None,
    history: History | None = None,
    near: Standpoint | None = None,
) -> Standpoint:
    """Where the platform is at commands (n, N) that are given one after the other.

    Parameters
    ----------
    identified : Identified
    extension : (n, N)
        Commanded extensions s = q - reference, mm or rad.
    surroundings : Surroundings, optional
        What the effects depend on beside it.
    history : History, optional
        What was commanded before; a machine at home if not given.
    near : Standpoint of N, optional
        Where to begin.

    Returns
    -------
    Standpoint
        ``agreed`` is False where the machine does not close.

    Raises
    ------
    BadInput
        If something is not told on which an effect depends.
    """
    surroundings, history = surroundings or Surroundings(), history or _home(identified)
    steps = np.arange(-1, extension.shape[1] - 1, dtype=np.intp)
    rows = command_rows(identified, extension, surroundings, history, steps)
    for _ in range(PASSES):
        near = one_pass(identified, rows, near)
        if np.all(near.agreed | ~near.closed.converged):
            break
    assert near is not None
    return near


def _home(identified: Identified) -> History:
    return History.at_home(identified.machine)


def one_pass(
    identified: Identified, rows: Rows, near: Standpoint | None, start: Configuration | None = None
) -> Standpoint:
    """Close the machine with the effects as they were, then ask the effects again.

    Parameters
    ----------
    rows : Rows
        Of :func:`command_rows`.
    near : Standpoint or None
        The pass before, at these commands or at others nearby; None for the first.
    start : Configuration, optional
        Where the first closure begins.
    """
    closing, extension = identified.closing, rows.extension
    parameters = identified.parameters
    if near is not None:
        extension = extension + near._done.extension
        if near._done.parameters is not None:
            parameters = parameters[:, None] + near._done.parameters
        start = near.closed
    elif start is not None and closing is not identified.machine:
        start = begun_at(closing, start)
    closed = forward(closing, extension, parameters, start)
    situation = _situation(identified, rows, closed, parameters)
    done = _asked(identified, situation)
    poses = closed.poses
    if done.twist.any():
        turned = product(exponential(done.twist[3:]), poses.rotation)
        poses = Poses(poses.position + done.twist[:3], turned)
    unrest = _unrest(identified, done, None if near is None else near._done)
    drift = done.extension if near is None else done.extension - near._done.extension
    return Standpoint(poses, closed, rows.extension, unrest, drift, done, lambda: situation)


def without_effects(
    identified: Identified,
    extension: Array,
    surroundings: Surroundings,
    history: History,
    steps: IntArray,
    start: Configuration,
) -> Standpoint:
    """A machine that has no effects: closed once, its derivatives made when they are asked for.

    Raises
    ------
    BadInput
        As :func:`command_rows` does.
    """
    count = extension.shape[1]
    for name in surroundings.channels:
        surroundings.channel(name, count)
    if surroundings.time_s is not None:
        history.path(extension, surroundings.times(count), identified.motion, steps)
    closed = forward(identified.closing, extension, identified.parameters, start)

    def situated() -> Situation:
        rows = command_rows(identified, extension, surroundings, history, steps)
        return _situation(identified, rows, closed, identified.parameters)

    none = np.zeros_like(extension)
    done = _Changes(none, None, np.zeros((6, count)))
    return Standpoint(closed.poses, closed, extension, np.zeros(count), none, done, situated)


def _situation(
    identified: Identified, rows: Rows, closed: Configuration, parameters: Array
) -> Situation:
    jacobians = pose_jacobians(identified.closing, closed, parameters)
    return Situation(
        rows=rows,
        passive_home=home_configuration(identified.machine).passive[:, 0],
        actuator_twists=jacobians.actuators,
        state_twists=jacobians.parameters,
        base_point=closed.poses.position,
        point=closed.poses.position,
        frame_rotation=np.repeat(np.eye(3)[:, :, None], rows.count, axis=2),
        closed=closed,
        state_of=np.arange(rows.count, dtype=np.intp),
        parameters=parameters,
        closing=identified.closing,
    )


def _asked(identified: Identified, situation: Situation) -> _Changes:
    """Sum of what every effect does there; nothing where a formula has no value."""
    count = situation.rows.count
    extension = np.zeros((len(identified.machine.actuators), count))
    parameters: Array | None = None
    twist = np.zeros((6, count))
    for found in identified.effects:
        signature: Signature = found.effect.signature(situation, found.values)
        if signature.extension is not None:
            extension += np.tensordot(found.amplitudes, signature.extension, axes=1)
        if signature.parameters is not None:
            changed = np.tensordot(found.amplitudes, signature.parameters, axes=1)
            parameters = changed if parameters is None else parameters + changed
        if signature.twist is not None:
            twist += np.tensordot(found.amplitudes, signature.twist, axes=1)
    return _Changes(extension, parameters, twist)


def _unrest(identified: Identified, now: _Changes, before: _Changes | None) -> Array:
    """Largest change between two passes (N,): lengths by the machine's size, turns in rad."""
    machine = identified.machine
    if before is None:
        return np.full(now.twist.shape[1], 0.0 if not identified.effects else np.inf)
    moved, units = identified.lengths
    parts = [
        np.abs(now.extension - before.extension) / moved,
        np.abs(now.twist[:3] - before.twist[:3]) / machine.size,
        np.abs(now.twist[3:] - before.twist[3:]),
    ]
    if now.parameters is not None and before.parameters is not None:
        parts.append(np.abs(now.parameters - before.parameters) / units)
    return np.asarray(np.max(np.concatenate(parts), axis=0))
