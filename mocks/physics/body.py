"""What the mock world asks of a kind of machine: hexapod, tripod and ptm are three bodies."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from calib.mechanism.description import Machine
from mocks.hidden.table import Hidden
from mocks.physics.actuators import Load
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array, Pose

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Place:
    """Where the tracker stands: ``height`` (low, high) of the base origin above it, mm.

    ``bearings``: so many directions suit, seen from the base; the first at ``first_rad``.
    """

    height: tuple[float, float]
    bearings: int = 6
    first_rad: float = float(np.pi / 6.0)


@dataclass(frozen=True)
class Surroundings:
    """What stands on and around a machine: nests in the frames of their carriers, mm; loads."""

    platform_nests: Mapping[str, Point]
    base_nests: Mapping[str, Point]
    place: Place
    load: Load = field(default_factory=Load)


class TrueMachine(Protocol):
    """One machine as it really is: its parameters and what is wrong with it are fixed."""

    def home(self, count: int) -> Pose:
        """``count`` copies of the nominal home pose."""

    def poses(self, c: Circumstances, start: Pose) -> Pose:
        """Poses at the N instants of ``c``; ``start`` (N poses) is nearby.

        Raises ArithmeticError or LinAlgError where the machine cannot close.
        """


class Body(Protocol):
    """A kind of machine.

    Attributes
    ----------
    kind : str
        Name of the shipped machine file whose mechanism it has.
    machine : Machine
        Its machine file.
    limbs : tuple of str
        The limb that each actuator drives, in their order.
    stroke : Stroke
        How large a move is, in the actuators' unit.
    around : Surroundings
    """

    kind: str
    machine: Machine
    limbs: tuple[str, ...]
    stroke: Stroke
    around: Surroundings

    def reference(self, held: Mapping[str, float]) -> Array:
        """q of every actuator at extension 0 in a controller with parameters ``held``, (n,)."""

    def commanded(self, held: Mapping[str, float], poses: Array) -> Array:
        """q (N, n) that a controller with parameters ``held`` computes for poses (N, k).

        ``poses`` in the machine's task coordinates, mm and rad; NaN where none belongs to a pose.
        """

    def real(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> TrueMachine:
        """A machine with these true parameters; ``settles``: it creeps and rings after moves.

        Raises ValueError for a hidden effect that this kind of machine does not have.
        """
