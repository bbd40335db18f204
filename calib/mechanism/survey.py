"""A look around the workspace of a machine: what it reaches, and where it is near a singularity.

The poses are those of a fixed sequence, so that two people who check one file read the same.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, Numbers
from calib.mechanism.closure import Closure, passive_twists
from calib.mechanism.configuration import joined
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.limits import within_limits
from calib.mechanism.solve import Configuration, home_configuration, inverse
from calib.mechanism.sweep import Standing
from calib.mechanism.task import task_values

POSES = 96
"""Poses at which a workspace is looked at."""


@dataclass(frozen=True, eq=False)
class Survey:
    """What was found at home (pose 0) and at the poses of the workspace that close.

    Attributes
    ----------
    asked : (n, POSES)
        Task coordinates that were tried, mm and rad.
    reached, usable : (POSES,) bool
        Whether the machine closes there, and is within strokes and joint limits.
    configuration : Configuration
        Home and the usable poses.
    stiffness : (N,)
        Smallest over largest singular value of the closure's rows, each of unit length: zero where
        the platform moves with all actuators held.
    side : (N,)
        Sign that changes where the machine passes a singularity; zero for over-constrained ones.
    effect : (P,)
        Largest effect of each parameter's sigma on a pose, mm (turns at the machine's size).
    """

    asked: Array
    reached: BoolArray
    usable: BoolArray
    configuration: Configuration
    stiffness: Array
    side: Array
    effect: Array


def survey(machine: Machine) -> Survey:
    """Look around; the machine must close at home."""
    home = home_configuration(machine)
    asked = workspace_poses(machine, task_values(machine.task, home.poses))
    found = inverse(machine, asked)
    usable = found.converged & within_limits(machine, found)
    if not np.any(usable):
        # A box of six coordinates may be reachable in its middle only.
        asked = _nearer_home(machine, asked, task_values(machine.task, home.poses))
        found = inverse(machine, asked)
        usable = found.converged & within_limits(machine, found)
    configuration = joined([home, found.take(np.flatnonzero(usable))])
    stiffness, side = _singularity(machine, configuration)
    moves = pose_jacobians(machine, configuration).parameters
    moves[:, 3:] *= machine.size
    effect = np.sqrt(np.max(np.sum(moves**2, axis=1), axis=-1)) * machine.prior_sigma
    return Survey(asked, found.converged, usable, configuration, stiffness, side, effect)


def workspace_poses(machine: Machine, home: Array) -> Array:
    """Task coordinates (n, POSES) spread evenly over the workspace; those without a range at home.

    An additive recurrence with the generalised golden ratio (as even as Sobol's, in one line).
    """
    names = machine.task.coordinates
    n = len(names)
    ratio = 1.0
    for _ in range(40):
        ratio = (1.0 + ratio) ** (1.0 / (n + 1))
    steps: Array = np.array([ratio**-k for k in range(1, n + 1)])
    spread: Array = (0.5 + steps[:, None] * np.arange(1, POSES + 1)) % 1.0
    ranges = [machine.workspace.get(k, (v, v)) for k, v in zip(names, home[:, 0], strict=True)]
    low, high = np.array(ranges).T
    values: Array = low[:, None] + (high - low)[:, None] * spread
    return values


def _nearer_home(machine: Machine, asked: Array, home: Array) -> Array:
    """The same poses in a box a fifth as wide, about the place of the workspace nearest to home."""
    names = machine.task.coordinates
    ranges = [machine.workspace.get(k, (v, v)) for k, v in zip(names, home[:, 0], strict=True)]
    low, high = np.array(ranges).T[:, :, None]
    centre = np.clip(home, low, high)
    values: Array = centre + 0.2 * (asked - centre)
    return values


def closure_at(machine: Machine, configuration: Configuration) -> Closure:
    """The closure linearised at closed configurations, nominal parameters."""
    standing = Standing.of(configuration)
    return Closure(machine, machine.nominal[:, None], configuration.extension, standing)


def unit_rows(closure: Closure) -> Numbers:
    """Rows of the closure (N, m, 6), each of unit length."""
    rows, _ = closure.rows()
    rows = rows / np.sqrt(np.sum(rows**2, axis=1))[:, None]
    return np.moveaxis(rows, -1, 0)


def _singularity(machine: Machine, configuration: Configuration) -> tuple[Array, Array]:
    closure = closure_at(machine, configuration)
    rows = unit_rows(closure)
    values = np.linalg.svd(rows, compute_uv=False)
    side = np.zeros(configuration.count)
    if rows.shape[1] == 6:
        side = np.sign(np.linalg.det(rows))
        for limb in closure.limbs:
            # The sign of a wrench basis is arbitrary; with the twists it completes it is not.
            whole = np.concatenate(
                [passive_twists(closure, limb), limb.wrenches.astype(float)], axis=1
            )
            signs = np.sign(np.linalg.det(np.moveaxis(whole, (0, 1), (-2, -1))))
            side = side * np.prod(signs, axis=0)
    return values[:, -1] / values[:, 0], side
