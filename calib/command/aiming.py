"""The machine closed so that its platform, every effect in it, is where it is wanted."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array
from calib.command.changes import Changes
from calib.command.identified import Identified
from calib.command.standing import Standpoint, situation_of, twisted
from calib.effects.component import Situation
from calib.mechanism.configuration import Configuration
from calib.mechanism.jacobian import PoseJacobians, pose_jacobians
from calib.mechanism.solve import begun_at, inverse
from calib.mechanism.task import FULL, task_error, task_moved
from calib.runs.stack import Rows


@dataclass(frozen=True, eq=False)
class Aim:
    """Where the limbs have to be for N wanted poses, if the effects change what they are said to.

    Attributes
    ----------
    identified : Identified
    goal : (k, N)
        Wanted task coordinates, mm and rad.
    closed : Configuration
        Of the machine that its effects leave; its extensions are those that the effects and the
        command have to make together.
    parameters : (P,) or (P, N)
        With which it was closed.
    shift : (k, N) or None
        What the effects do to the platform itself, away from ``goal``, as ``task_error`` has it.
    """

    identified: Identified
    goal: Array
    closed: Configuration
    parameters: Array
    shift: Array | None = None

    @classmethod
    def at(
        cls, identified: Identified, goal: Array, plain: Configuration, changes: Changes | None
    ) -> "Aim":
        """The first one, from the machine without effects there."""
        first = cls(identified, goal, plain, identified.parameters)
        closing = identified.closing
        if closing is not identified.machine:
            began = begun_at(closing, plain)
            first = replace(first, closed=inverse(closing, goal, identified.parameters, began))
        return first if changes is None else first.moved(changes)

    def moved(self, changes: Changes) -> "Aim":
        """The same for what the effects really change there."""
        if changes.parameters is None and changes.twist is None:
            return self
        parameters = self.identified.parameters
        if changes.parameters is not None:
            parameters = parameters[:, None] + changes.parameters
        shift, goal = self._shifted(changes), self.goal
        if shift is not None:
            goal = task_moved(self.identified.machine.task, goal, shift)
        closed = inverse(self.identified.closing, goal, parameters, self.closed)
        return replace(self, closed=closed, parameters=parameters, shift=shift)

    def _shifted(self, changes: Changes) -> Array | None:
        """Where to close the machine, so that it is at the goal after the twist (6, N)."""
        if changes.twist is None:
            return None
        task = self.identified.machine.task
        if task.coordinates == FULL:
            return -changes.twist
        now = twisted(self.closed.poses, changes)
        error = task_error(task, self.goal, now.position, now.rotation)
        return np.asarray(error if self.shift is None else self.shift + error)

    @cached_property
    def jacobians(self) -> PoseJacobians:
        """Derivatives of the pose there."""
        return pose_jacobians(self.identified.closing, self.closed, self.parameters)

    def standing(self, extension: Array, unrest: Array, changes: Changes) -> Standpoint:
        """Where the machine stands at commands (n, N) with which it is closed so."""
        return Standpoint(self.closed, extension, unrest, changes, lambda: self.jacobians)

    def situation(self, rows: Rows) -> Situation:
        """What effects are asked at, the commands known."""
        return situation_of(self.identified, rows, self.closed, self.parameters, self.jacobians)
