"""The linear map from everything unknown to everything read, in units of prior and noise.

Unknown are the machine's parameters (unit: their prior sigma) and, where asked for, the six of the
base frame in the tracker's frame and three of every platform nest. Read are SMR centres in nests
on the platform and on the base, or whole poses; every row has unit variance.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import cross, rotate
from calib.poses.information import FRAME_SIGMA, Judge, frame_columns
from calib.poses.reach import PoseSet
from calib.poses.readings import PoseNoise, Readings

FRAME_NAMES = ("frame.x", "frame.y", "frame.z", "frame.rx", "frame.ry", "frame.rz")
NEST_SIGMA = 0.05
"""Prior of a nest that is not known exactly, mm (effects catalogue, nest-offset)."""


@dataclass(frozen=True, eq=False)
class Sights:
    """What is read at every pose, and what else is unknown.

    Attributes
    ----------
    nests : (3, M)
        SMR centres on the platform, platform frame, mm; (3, 0): the pose is read whole.
    sigma : float
        Standard uncertainty per axis, mm.
    base : (3, B)
        SMR centres on the base, base frame, mm, each read ``base_reads`` times.
    frame_free, nests_free : bool
        Whether the base frame, and the nests, have to be found as well.
    pose_noise : Readings, optional
        What is read of poses otherwise: whole, or heights, in a known frame.
    """

    nests: Array
    sigma: float = 0.005
    base: Array = field(default_factory=lambda: np.zeros((3, 0)))
    base_reads: int = 2
    frame_free: bool = False
    nests_free: bool = False
    pose_noise: Readings | None = None

    def __post_init__(self) -> None:
        if (self.pose_noise is None) != (self.nests.shape[1] > 0):
            raise BadInput("neither nests nor whole poses are read", remedy="Give one of the two.")
        if self.nests_free and self.pose_noise is not None:
            raise BadInput(
                "poses read whole have no nests that could be free", remedy="Leave nests_free out"
            )

    @property
    def says(self) -> str:
        """What is read, in words."""
        if self.pose_noise is not None:
            read = self.pose_noise.says
        else:
            count = self.nests.shape[1]
            read = f"{count} platform nest{'s' * (count > 1)}, +-{self.sigma * 1e3:.3g} um per axis"
        free = [
            word
            for word, is_so in (("base frame", self.frame_free), ("nests", self.nests_free))
            if is_so
        ]
        tied = f", {self.base.shape[1]} base nests" if self.base.shape[1] else ""
        return f"{read}{tied}; {' and '.join(free) + ' free' if free else 'frames known'}"


@dataclass(frozen=True, eq=False)
class Observation:
    """Rows A (rows, p) of unit variance; unknown k in units of ``scale[k]``.

    ``prior`` (p,): 1 where a prior of that size is held, 0 where nothing is known.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    scale: Array
    prior: Array
    A: Array
    geometry: int
    """How many of the unknowns are parameters of the machine; they come first."""

    def only(self, which: list[int]) -> "Observation":
        """The same readings with some of the unknowns; the others are held."""
        return replace(
            self,
            names=tuple(self.names[k] for k in which),
            units=tuple(self.units[k] for k in which),
            scale=self.scale[which],
            prior=self.prior[which],
            A=self.A[:, which],
            geometry=sum(k < self.geometry for k in which),
        )


def observe(poses: PoseSet, sights: Sights) -> Observation:
    """Linearise what would be read at some poses of the nominal machine."""
    machine = poses.machine
    J = pose_jacobians(machine, poses.configuration).parameters * machine.prior_sigma[:, None, None]
    names = [p.name for p in machine.parameters]
    units = [p.unit for p in machine.parameters]
    scale, prior = machine.prior_sigma, np.ones(len(names))
    twists = J
    if sights.frame_free:
        frame = np.array(FRAME_SIGMA) * 1e-3
        twists = np.concatenate([J, frame_columns(poses.poses) * frame[:, None, None]])
        names += FRAME_NAMES
        units += ["mm"] * 3 + ["rad"] * 3
        scale, prior = np.concatenate([scale, frame]), np.concatenate([prior, np.zeros(6)])
    blocks = [_rows_of_pose(poses, sights, twists)]
    if sights.frame_free and sights.base.shape[1]:
        blocks.append(_rows_of_base(sights, len(J), scale[len(J) :]))
    A = np.concatenate(blocks, axis=1).T
    if sights.nests_free:
        A = np.hstack([A, _nest_columns(poses, sights, len(A))])
        for nest in range(sights.nests.shape[1]):
            names += [f"nest{nest + 1}.{axis}" for axis in "xyz"]
        extra = 3 * sights.nests.shape[1]
        units += ["mm"] * extra
        scale = np.concatenate([scale, np.full(extra, NEST_SIGMA)])
        prior = np.concatenate([prior, np.zeros(extra)])
    return Observation(tuple(names), tuple(units), scale, prior, A, len(J))


def _rows_of_pose(poses: PoseSet, sights: Sights, twists: Array) -> Array:
    """Rows (p, rows) of the readings at the poses, for unknowns that move the platform."""
    p = len(twists)
    if sights.pose_noise is not None:
        whole: Array = np.einsum("rin,pin->prn", sights.pose_noise.root(poses.poses), twists)
        return whole.reshape(p, -1)
    parts = []
    for nest in sights.nests.T:
        arm = rotate(poses.poses.rotation, nest[:, None])
        moved = twists[:, :3] + np.moveaxis(
            cross(np.moveaxis(twists[:, 3:], 1, 0), arm[:, None, :]), 0, 1
        )
        parts.append(moved.reshape(p, -1) / sights.sigma)
    return np.concatenate(parts, axis=1)


def _rows_of_base(sights: Sights, parameters: int, frame: Array) -> Array:
    """Rows of the base nests: only the frame moves them."""
    count = sights.base.shape[1]
    rows = np.zeros((parameters + 6, 3 * count))
    for b, point in enumerate(sights.base.T):
        x, y, z = point
        move = np.vstack([np.eye(3), [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]])
        rows[parameters:, 3 * b : 3 * b + 3] = move * frame[:, None]
    scaled: Array = rows * np.sqrt(sights.base_reads) / sights.sigma
    return scaled


def _nest_columns(poses: PoseSet, sights: Sights, rows: int) -> Array:
    """Columns (rows, 3 M): a nest that is elsewhere on the platform moves its own readings."""
    count, nests = poses.count, sights.nests.shape[1]
    out = np.zeros((rows, 3 * nests))
    R = poses.poses.rotation.reshape(3, 3, count)
    for nest in range(nests):
        begin = 3 * count * nest
        for axis in range(3):
            column = R[:, axis].reshape(-1) * NEST_SIGMA / sights.sigma
            out[begin : begin + 3 * count, 3 * nest + axis] = column
    return out


class _Tracker(PoseNoise):
    """Judges in the frame of the fit: what a frame error does to the pose counts."""

    @property
    def frame_free(self) -> bool:
        return True


def judge(poses: PoseSet, observation: Observation) -> Judge:
    """Mean of J^T J over fresh poses for the unknowns of an observation (nests move no pose)."""
    framed = any(name in FRAME_NAMES for name in observation.names)
    readings: Readings = _Tracker(1.0, None) if framed else PoseNoise(1.0, None)
    p = len(observation.names)
    moving = observation.geometry + (6 if framed else 0)
    found = Judge.over(poses, readings, observation.scale[:moving])
    position, orientation = np.zeros((p, p)), np.zeros((p, p))
    position[:moving, :moving] = found.position
    orientation[:moving, :moving] = found.orientation
    return Judge(position, orientation)
