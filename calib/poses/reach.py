"""Poses that the machine can take: drawn in the workspace box, kept within strokes and joints."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, Selection
from calib.errors import BadInput
from calib.mechanism.configuration import joined
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin, within_limits
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import Configuration, inverse

MARGIN = 1e-6
"""Kept from every limit, mm or rad: a rounded coordinate must not be refused by a controller."""
SINGULAR = 1e-6
"""Conditioning of the closure below which a pose counts as singular."""
DRAWS = 64
"""Batches drawn before the workspace box is given up as hardly reachable."""


@dataclass(frozen=True, eq=False)
class PoseSet:
    """Poses of a machine, solved with its nominal parameters.

    Attributes
    ----------
    machine : Machine
    task : (n, N)
        Commanded task coordinates, in the task's order, mm and rad.
    configuration : Configuration of N poses
    """

    machine: Machine
    task: Array
    configuration: Configuration

    @property
    def count(self) -> int:
        """Number of poses N."""
        return int(self.task.shape[1])

    @property
    def poses(self) -> Poses:
        """Platform poses in the base frame."""
        return self.configuration.poses

    @property
    def q(self) -> Array:
        """Actuator coordinates (n, N) for a controller that holds nominal parameters."""
        return self.machine.coordinates(self.configuration.extension)

    def take(self, which: Selection) -> "PoseSet":
        """Poses selected by an index, slice or mask."""
        return PoseSet(self.machine, self.task[:, which], self.configuration.take(which))


def solve_poses(machine: Machine, task: Array) -> PoseSet:
    """Solve task coordinates (n, N) with the nominal machine; nothing is left out."""
    return PoseSet(machine, task, inverse(machine, task))


def reachable(
    machine: Machine, configuration: Configuration, margin: Margin | None = None
) -> BoolArray:
    """Whether poses close, away from singularities, within strokes and joint limits; (N,).

    ``margin`` is kept free at the ends of all ranges.
    """
    q = machine.coordinates(configuration.extension)
    low, high = machine.q_limits.T[:, :, None]
    inside = within_limits(machine, configuration, margin=margin)
    inside &= configuration.conditioning > SINGULAR
    inside &= np.all((q >= low + MARGIN) & (q <= high - MARGIN), axis=0)
    return inside


def workspace_box(machine: Machine) -> tuple[Array, Array]:
    """Lower and upper corner (n,) of the box in which poses are sought, in the task's order.

    Raises
    ------
    BadInput
        If the machine file gives no range for a task coordinate.
    """
    for name in machine.task.coordinates:
        if name not in machine.workspace:
            raise BadInput(
                f'no range for the task coordinate "{name}"',
                place=machine.source,
                remedy=f"Add {name} = [low, high] to [workspace].",
            )
    low, high = np.array([machine.workspace[name] for name in machine.task.coordinates]).T
    return low, high


def rounded(machine: Machine, task: Array) -> Array:
    """Round task coordinates to 0.001 mm and 0.001 deg, so that a file holds them exactly."""
    lengths = np.array([name in "xyz" for name in machine.task.coordinates])[:, None]
    degrees: Array = np.deg2rad(np.round(np.rad2deg(task), 3))
    return np.where(lengths, np.round(task, 3), degrees)


def sample_poses(
    machine: Machine, count: int, generator: np.random.Generator, margin: Margin | None = None
) -> PoseSet:
    """Draw reachable poses, uniform in the workspace box.

    Parameters
    ----------
    machine : Machine
    count : int
        How many poses are wanted.
    generator : numpy Generator
        The only source of chance: the same generator state gives the same poses.
    margin : Margin, optional
        Kept free at the ends of all ranges.

    Raises
    ------
    BadInput
        If the box holds hardly any reachable pose.
    """
    low, high = workspace_box(machine)
    kept: list[PoseSet] = []
    have = drawn = 0
    for _ in range(DRAWS):
        share = max(have / drawn, 0.05) if drawn else 0.5
        batch = int(1.1 * (count - have) / share) + 16
        unit = generator.random((len(low), batch))
        found = solve_poses(machine, rounded(machine, low[:, None] + (high - low)[:, None] * unit))
        found = found.take(reachable(machine, found.configuration, margin))
        kept.append(found)
        have, drawn = have + found.count, drawn + batch
        if have >= count:
            return joined_poses(machine, kept).take(slice(0, count))
    raise BadInput(
        f"only {have} of {drawn} poses of the workspace box can be reached",
        place=machine.source,
        remedy="Narrow [workspace], or widen the limits of actuators and joints.",
    )


def joined_poses(machine: Machine, parts: list[PoseSet]) -> PoseSet:
    """Pose sets one after the other."""
    if len(parts) == 1:
        return parts[0]
    return PoseSet(
        machine,
        np.concatenate([part.task for part in parts], axis=1),
        joined([part.configuration for part in parts]),
    )
