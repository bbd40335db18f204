"""Where the readings of a run stand, seen by the nominal machine: what the gross hypotheses share.

A hypothesis changes the record (labels, the nest table, the frame from some reading on) and is
worth the readings that then stand where their nests can be. It is held where it explains clearly
more of them than the record as it stands: one that moves forty readings is tried against the
exclusion of forty.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.frames import align
from calib.identify.alignment import collinear, misfit, robust_align
from calib.identify.starting import aligned, disagreement, slack_of
from calib.mechanism.description import Machine
from calib.mechanism.rigid import rotate
from calib.model.prediction import Model
from calib.runs.record import Run
from calib.runs.sensing import POINT
from calib.runs.stack import Rows, stack

FEW = 4
"""Wrong readings up to so many, or this part of a run, are matters of single readings."""
PART = 0.03
ROUGH_MM = 0.3
"""Standard deviation of a nest's place beyond which nothing is said of where its readings stand."""
Frame = tuple[Array, Array]
"""Rotation (3, 3) and position (3,) of the base in the tracker frame."""


@dataclass(frozen=True, eq=False)
class Places:
    """A run's N readings beside where the nominal machine had the nests.

    Attributes
    ----------
    run, rows : Run, Rows
    position, rotation : (3, N), (3, 3, N)
        The platform in the base frame, by the nominal machine.
    base : (3, N)
        Where the labelled nest stood, base frame, mm.
    slack : (N,)
        How far from it a good reading may be, mm; more where the machine as a whole seems off.
    tight : (N,)
        The same by the tolerances alone, mm.
    """

    run: Run
    rows: Rows
    position: Array
    rotation: Array
    base: Array
    slack: Array
    tight: Array

    @property
    def seen(self) -> Array:
        """What the tracker read (3, N), mm."""
        return self.rows.position

    @cached_property
    def limit(self) -> int:
        """How many readings a hypothesis must explain beyond the record as it stands."""
        return max(FEW, int(np.ceil(PART * self.rows.count)))

    @cached_property
    def majority(self) -> tuple[Frame, BoolArray]:
        """Frame that most readings share, and which (N,) stand where they should in it."""
        rotation, position, inside = robust_align(self.base, self.seen, self.slack)
        return (rotation, position), inside

    @cached_property
    def strict(self) -> "Places":
        """The same by the tolerances alone: a wrong record makes a machine seem off as a whole."""
        if np.array_equal(self.slack, self.tight):
            return self
        return replace(self, slack=self.tight)

    @property
    def standing(self) -> int:
        """How many readings stand where they should in the frame that most share."""
        return int(self.majority[1].sum())

    @cached_property
    def from_base(self) -> Frame | None:
        """Frame of the nests on the base alone, where they fit one another."""
        fixed = ~self.rows.on_platform
        if collinear(self.base[:, fixed]):
            return None
        frame = align(self.base[:, fixed], self.seen[:, fixed])
        apart = misfit(self.base[:, fixed], self.seen[:, fixed], *frame)
        return frame if np.all(apart < self.slack[fixed]) else None

    def inside(self, frame: Frame, base: Array | None = None) -> BoolArray:
        """Which readings (N,) stand within their slack of ``base`` (3, N)."""
        where = self.base if base is None else base
        return np.asarray(misfit(where, self.seen, *frame) < self.slack)

    def at(self, nests: Array) -> Array:
        """Places (3, N) in the base frame of platform nests (3, N)."""
        return self.position + rotate(self.rotation, nests)

    def with_nests(self, nests: Array) -> Array:
        """Places (3, N) of all readings if the labelled nests were ``nests`` (3, N)."""
        return np.where(self.rows.on_platform, self.at(nests), nests)

    def in_nest_frame(self, frame: Frame) -> Array:
        """Readings (3, N) brought back: platform frame where on the platform, else base frame."""
        rotation, position = frame
        base = rotation.T @ (self.seen - position[:, None])
        own = np.einsum("jin,jn->in", self.rotation, base - self.position)
        return np.where(self.rows.on_platform, own, base)


def points_of_one(run: Run) -> bool:
    """Whether all readings are whole points of one tracker in a frame of its own."""
    own = run.sensing
    if own is None:
        return True
    read = run.measured
    setup = run.header.setup
    names = {own.instrument[row] for row in np.flatnonzero(read)}
    if len(names) != 1 or setup is None:
        return False
    used = setup.of(names.pop())
    steady = used.frame == "free" and used.zero_sigma is None and used.scale_sigma is None
    return steady and bool(np.all(own.kind[read] == POINT) and np.all(own.seen[:, read]))


def roughly_known(run: Run) -> bool:
    """Whether some nest may be so far from where the table says that no reading can be placed."""
    setup = run.header.setup
    nests = {} if setup is None else setup.nests
    return any(np.linalg.eigvalsh(one)[-1] > ROUGH_MM**2 for one in nests.values())


def places_of(machine: Machine, run: Run) -> Places | None:
    """Stand a run beside the nominal machine; None where that cannot be done at all."""
    if not run.measured.any():
        return None
    try:
        rows = stack(machine, [run])
        model = Model(rows)
        base = model.base_points()
        _, linear = aligned(model, base, np.ones(rows.count, dtype=bool))
    except BadInput:
        return None  # the fit says it, with the place
    tight = slack_of(model, linear)
    slack = tight + disagreement(model, base, np.arange(rows.count), tight)
    poses, (_, state) = model.nominal_configuration.poses, model.states
    return Places(
        run, rows, poses.position[:, state], poses.rotation[:, :, state], base, slack, tight
    )
