"""Where the platform really stands at given commands, every machine effect in it.

An effect depends on the pose that it changes, weakly: geometry is closed at the extensions that
the effects of the pass before make of the commands, and the effects are asked again, until both
agree. What an effect does to the platform itself (``Signature.twist``) comes last:
x -> x + v, R -> exp(omega) R.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.command.changes import AGREED, Changes, changes_at, unrest
from calib.command.history import History
from calib.command.identified import Identified
from calib.command.surroundings import Surroundings
from calib.command.told import Told
from calib.effects.component import Situation
from calib.mechanism.jacobian import PoseJacobians, pose_jacobians
from calib.mechanism.rigid import Poses, exponential, product
from calib.mechanism.solve import Configuration, forward, home_configuration
from calib.runs.stack import Rows

PASSES = 40


@dataclass(frozen=True, eq=False)
class Standpoint:
    """A machine at N commands.

    Attributes
    ----------
    closed : Configuration
        Of the machine that its effects leave, at the extensions that they make of the commands.
    extension : (n, N)
        As commanded, mm or rad.
    unrest : (N,)
        How much the effects changed in the last pass, as a part of the machine's size.
    changes : Changes
        What they change there.
    """

    closed: Configuration
    extension: Array
    unrest: Array
    changes: Changes
    _derived: Callable[[], PoseJacobians]

    @cached_property
    def poses(self) -> Poses:
        """Where the platform is."""
        return twisted(self.closed.poses, self.changes)

    @property
    def jacobians(self) -> PoseJacobians:
        """Derivatives of the pose by parameters and extensions."""
        return self._derived()

    @property
    def agreed(self) -> BoolArray:
        """Whether the machine closes, and its effects agree with where it stands, (N,)."""
        return self.closed.converged & (self.unrest <= AGREED)

    @property
    def twists(self) -> Array:
        """Derivative (n, 6, N) of the platform's twist by each extension, base axes."""
        return self.jacobians.actuators


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
    surroundings = surroundings or Surroundings()
    history = history or History.at_home(identified.machine)
    steps = np.arange(-1, extension.shape[1] - 1, dtype=np.intp)
    rows = Told.of(identified, surroundings, history, steps).rows(extension)
    for _ in range(PASSES):
        near = _one_pass(identified, rows, near)
        if np.all(near.agreed | ~near.closed.converged):
            break
    assert near is not None
    return near


def _one_pass(identified: Identified, rows: Rows, near: Standpoint | None) -> Standpoint:
    """Close the machine with the effects as they were, then ask the effects again.

    ``near`` is the pass before, at these commands or at others nearby; None for the first.
    """
    extension, parameters = rows.extension, identified.parameters
    before = None if near is None else near.changes
    if before is not None:
        extension = extension + before.extension
        if before.parameters is not None:
            parameters = parameters[:, None] + before.parameters
    start = None if near is None else near.closed
    closed = forward(identified.closing, extension, parameters, start)
    jacobians = pose_jacobians(identified.closing, closed, parameters)
    situation = situation_of(identified, rows, closed, parameters, jacobians)
    changes = changes_at(identified, situation)
    moved = unrest(identified, changes, before)
    return Standpoint(closed, rows.extension, moved, changes, lambda: jacobians)


def twisted(poses: Poses, changes: Changes) -> Poses:
    """Platform poses after what the effects do to the platform itself."""
    twist = changes.twist
    if twist is None:
        return poses
    turned = product(exponential(twist[3:]), poses.rotation)
    return Poses(poses.position + twist[:3], turned)


def situation_of(
    identified: Identified,
    rows: Rows,
    closed: Configuration,
    parameters: Array,
    jacobians: PoseJacobians,
) -> Situation:
    """What effects are asked at: commands ``rows``, and the machine as it is closed at them."""
    upright, own = _one_each(rows.count)
    return Situation(
        rows=rows,
        passive_home=home_configuration(identified.machine).passive[:, 0],
        actuator_twists=jacobians.actuators,
        state_twists=jacobians.parameters,
        base_point=closed.poses.position,
        point=closed.poses.position,
        frame_rotation=upright,
        closed=closed,
        state_of=own,
        parameters=parameters,
        closing=identified.closing,
    )


@lru_cache(maxsize=16)
def _one_each(count: int) -> tuple[Array, IntArray]:
    """Rotations (3, 3, N) that turn nothing, and a state of its own (N,) for each; read only."""
    upright, own = np.repeat(np.eye(3)[:, :, None], count, axis=2), np.arange(count, dtype=np.intp)
    upright.setflags(write=False)
    own.setflags(write=False)
    return upright, own
