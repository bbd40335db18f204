"""What the readings at a pose tell about the platform's pose there.

Whatever is read, to first order it is a linear map of the platform's twist (in the tracker's view)
with known noise, so each model gives a root K of the information: K^T K is the 6 x 6 information
about the twist [v mm; omega rad]. Nests read at a pose thus cost no more than a pose read whole.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.rigid import Poses, cross, rotate


class Readings(Protocol):
    """A way of measuring."""

    @property
    def says(self) -> str:
        """What is read, in words."""

    @property
    def frame_free(self) -> bool:
        """Whether the base frame in the tracker frame has to be found as well."""

    def root(self, poses: Poses) -> Array:
        """Root K (m, 6, N) of the information about the twist at each pose; m <= 6."""

    def frame_information(self) -> Array:
        """Information (6, 6) about the base frame's twist at the base origin, from base nests."""


@dataclass(frozen=True)
class PoseNoise:
    """Poses read whole, with white noise of a standard deviation in mm and rad.

    ``angle_sigma`` None: only the position is read. The base frame is known.
    """

    position_sigma: float
    angle_sigma: float | None

    @property
    def says(self) -> str:
        """What is read, in words."""
        position = f"+-{self.position_sigma * 1e3:.3g} um"
        if self.angle_sigma is None:
            return f"positions, {position} per axis (1 sigma)"
        turn = np.rad2deg(self.angle_sigma) * 1e3
        return f"whole poses, {position}, +-{turn:.3g} mdeg per axis (1 sigma)"

    @property
    def frame_free(self) -> bool:
        """The frame is known."""
        return False

    def root(self, poses: Poses) -> Array:
        """Diagonal root (3 or 6, 6, N)."""
        sigmas = [self.position_sigma] * 3
        if self.angle_sigma is not None:
            sigmas += [self.angle_sigma] * 3
        root = np.zeros((len(sigmas), 6, poses.count))
        for i, sigma in enumerate(sigmas):
            root[i, i] = 1.0 / sigma
        return root

    def frame_information(self) -> Array:
        """Nothing is asked about the frame."""
        return np.zeros((6, 6))


HAN_2020 = PoseNoise(0.02 / np.sqrt(3.0), float(np.deg2rad(0.004) / np.sqrt(3.0)))
"""The noise of Han et al. 2020: uniform, +-0.02 mm and +-0.004 deg."""


@dataclass(frozen=True, eq=False)
class NestReadings:
    """SMR nests on the platform, read by a tracker that stands somewhere.

    Attributes
    ----------
    nests : (3, M)
        SMR centres in the platform frame, mm.
    sigma : float
        Standard uncertainty of a reading per axis, mm.
    base : (3, B)
        Reference nests in the base frame, mm.
    base_reads : int
        How often each of them is read during the run.
    """

    nests: Array
    sigma: float
    base: Array
    base_reads: int = 2

    def __post_init__(self) -> None:
        if self.nests.ndim != 2 or self.nests.shape[0] != 3 or self.nests.shape[1] < 1:
            raise BadInput(
                f"nests have the shape {self.nests.shape}", remedy="Give (3, M), M at least 1"
            )
        if self.sigma <= 0.0:
            raise BadInput(
                "the uncertainty of a reading is not positive", remedy="Give it in mm, above 0"
            )

    @property
    def says(self) -> str:
        """What is read, in words."""
        return (
            f"{self.nests.shape[1]} platform nests, +-{self.sigma * 1e3:.3g} um per axis "
            f"(1 sigma); {self.base.shape[1]} base nests read {self.base_reads} times"
        )

    @property
    def frame_free(self) -> bool:
        """The frame is found from the same readings."""
        return True

    def root(self, poses: Poses) -> Array:
        """Triangular root (6, 6, N) of sum over nests of [I, -[R m]x]^T [I, -[R m]x] / sigma^2."""
        information = sum(
            _point_information(rotate(poses.rotation, m[:, None])) for m in self.nests.T
        )
        return _root(np.moveaxis(np.asarray(information), -1, 0) / self.sigma**2)

    def frame_information(self) -> Array:
        """What the base nests tell about the frame."""
        information = np.zeros((6, 6))
        for point in self.base.T:
            information += _point_information(point[:, None])[:, :, 0]
        return self.base_reads * information / self.sigma**2


@dataclass(frozen=True, eq=False)
class DirectionReadings:
    """Components of nests on the platform along known directions: heights, dial gauges.

    Attributes
    ----------
    nests : (3, M)
        Platform frame, mm.
    axes : (3, K)
        Unit directions, base frame; every nest is read along each.
    sigma : float
        Standard uncertainty of a component, mm.
    """

    nests: Array
    axes: Array
    sigma: float

    def __post_init__(self) -> None:
        if self.sigma <= 0.0:
            raise BadInput(
                "the uncertainty of a reading is not positive", remedy="Give it in mm, above 0"
            )

    @property
    def says(self) -> str:
        """What is read, in words."""
        nests, axes = self.nests.shape[1], self.axes.shape[1]
        heights = axes == 1 and np.allclose(self.axes[:, 0], (0.0, 0.0, 1.0))
        what = "heights" if heights else f"components along {axes} directions"
        of = (
            "the platform's origin"
            if not np.any(self.nests)
            else f"{nests} platform nest{'s' if nests > 1 else ''}"
        )
        return f"{what} of {of}, +-{self.sigma * 1e3:.3g} um (1 sigma)"

    @property
    def frame_free(self) -> bool:
        """The directions are known in the base frame."""
        return False

    def root(self, poses: Poses) -> Array:
        """Root (6, 6, N) of the sum over nests and axes a of r^T r / sigma^2, r = [a, R m x a]."""
        rows = []
        for nest in self.nests.T:
            arm = rotate(poses.rotation, nest[:, None])
            for axis in self.axes.T:
                along = np.repeat(axis[:, None], poses.count, axis=1)
                rows.append(np.concatenate([along, cross(arm, along)]))
        return pose_root(np.array(rows) / self.sigma)

    def frame_information(self) -> Array:
        """Nothing is asked about the frame."""
        return np.zeros((6, 6))


def _point_information(arm: Array) -> Array:
    """[I, -[a]x]^T [I, -[a]x], shape (6, 6, N), for points at ``arm`` (3, N) from the origin."""
    rows = np.zeros((3, 6, arm.shape[1]))
    for i in range(3):
        axis = np.zeros((3, 1))
        axis[i] = 1.0
        rows[i, i] = 1.0
        rows[:, 3 + i] = cross(np.broadcast_to(axis, arm.shape), arm)
    out: Array = np.einsum("rin,rjn->ijn", rows, rows)
    return out


def pose_root(rows: Array) -> Array:
    """K (6, 6, N) with K^T K the sum over M whitened rows (M, 6, N) of r^T r."""
    return _root(np.einsum("rin,rjn->nij", rows, rows))


def _root(information: Array) -> Array:
    """K (6, 6, N) with K^T K = information (N, 6, 6), which may be singular (one nest: rank 3)."""
    # Lengths and angles are balanced first, so that the cut at rounding means the same for both.
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", information), 1e-300))
    values, vectors = np.linalg.eigh(information / scale[:, :, None] / scale[:, None, :])
    values = np.where(values > 1e-12 * values[:, -1:], values, 0.0)
    K = np.sqrt(values)[:, :, None] * np.swapaxes(vectors, 1, 2) * scale[:, None, :]
    return np.ascontiguousarray(np.moveaxis(K, 0, -1))
