"""What a simulated campaign is: machine, poses, order, noise, climate, load, hidden effects."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mocks.hidden.table import Hidden
from mocks.physics.actuators import Load
from mocks.physics.bodies import body_named
from mocks.physics.body import Body
from mocks.physics.pose import Array

Order = Literal["nest-by-nest", "pose-by-pose"]


@dataclass(frozen=True)
class Profile:
    """Channels over the run.

    The structure warms by ``rise_K`` in all, saturating; the air wanders. ``payload_kg`` is
    constant, or a sequence of masses that are put on in turn, each for an equal part of the run.
    """

    start_C: float = 20.0
    rise_K: float = 6.0
    air_C: float = 20.4
    payload_kg: tuple[float, ...] = (0.0,)


@dataclass(frozen=True)
class RunPlan:
    """One campaign.

    Attributes
    ----------
    machine : str
        A machine that there is a body of (``mocks.physics.bodies``); else what its run says.
    own_body : Body, optional
        The body of a machine of one's own.
    seed : int
        Draws truth, room, noise and, where ``poses`` is a number, the poses.
    poses : int or array, shape (N, k)
        How many random reachable poses, or the poses in the machine's task coordinates, mm and
        rad.
    nests : tuple of str
        Platform nests that are measured; all if empty.
    order : {"nest-by-nest", "pose-by-pose"}
        One SMR that is carried after each pass, or three SMRs.
    cycles : int
        How often all poses are visited with each nest; with more than one the file has a column
        ``cycle``.
    noise_mm : float or None
        Standard deviation per axis of every reading; None: radial and angular parts of a tracker,
        with covariances in the file.
    base_every : int
        Readings between two visits of the base nests.
    parameters : mapping, optional
        True parameters; drawn by ``seed`` from ``prior`` if None.
    load : Load, optional
        That of the machine's surroundings if None.
    controller : mapping
        Parameters that the controller uses where they are not nominal.
    delays : bool
        Whether the file has a column ``delay_s`` (it has one whenever something settles).
    strays : int
        So many readings are off by 0.2 mm to 2 mm.
    """

    seed: int = 1
    poses: int | Array = 60
    order: Order = "nest-by-nest"
    nests: tuple[str, ...] = ()
    cycles: int = 1
    noise_mm: float | None = 0.005
    base_every: int = 45
    hidden: Hidden = field(default_factory=Hidden)
    parameters: Mapping[str, float] | None = None
    prior: Literal["uniform", "normal"] = "uniform"
    controller: Mapping[str, float] = field(default_factory=dict)
    profile: Profile = field(default_factory=Profile)
    load: Load | None = None
    delays: bool = False
    strays: int = 0
    title: str = ""
    machine: str = "hexapod"
    own_body: Body | None = None

    @property
    def body(self) -> Body:
        """The machine."""
        return self.own_body or body_named(self.machine)

    def rng(self, purpose: int) -> np.random.Generator:
        """A generator of its own for each purpose, so that one choice does not shift another."""
        return np.random.default_rng([self.seed, 100 + purpose])
