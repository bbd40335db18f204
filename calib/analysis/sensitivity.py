"""How much every geometric error matters: local and global indices, and tolerances from them.

The local index of an error is the norm of its column of the error Jacobian, position and
orientation apart (Zhang et al. 2018, eq. 21); the global one its mean over the workspace (eq. 22),
with its spread (Feng et al. 2022, eqs. 11, 12). Errors of a kind (``limb1.h``, ``limb2.h`` ..)
taken together give the root of the sum of squares: the standard deviation of the pose error per
standard deviation of the kind, the same and independent in every limb.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.mechanism.jacobian import pose_jacobians
from calib.poses.reach import PoseSet

COVERAGE = 3.0
"""A tolerance is this many standard deviations (Feng et al. 2022, section II D)."""


@dataclass(frozen=True)
class Index:
    """Global sensitivity of the pose to one error, or to one kind of error.

    Means and standard deviations over the workspace: of the position in mm and of the orientation
    in rad, per mm or rad of the error (``unit``).
    """

    name: str
    unit: str
    says: str
    position: float
    position_spread: float
    orientation: float
    orientation_spread: float
    tolerance: float
    """The machine file's tolerance (uniform half-width), in ``unit``."""

    @property
    def position_share(self) -> float:
        """Position error in mm (1 sigma) that the file's tolerance causes, on average."""
        return float(self.position * self.tolerance / np.sqrt(3.0))

    @property
    def orientation_share(self) -> float:
        """Orientation error in rad (1 sigma) that the file's tolerance causes, on average."""
        return float(self.orientation * self.tolerance / np.sqrt(3.0))


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Indices of every parameter and of every kind, strongest effect of the tolerance first."""

    parameters: tuple[Index, ...]
    kinds: tuple[Index, ...]
    poses: int
    position_sigma: float
    """Position error in mm (RMS over the workspace) of a machine within the file's tolerances."""
    orientation_sigma: float
    """The same of the orientation, rad."""


def kind_of(name: str) -> str:
    """Kind of a parameter: its name without the limb (``leg1.B_x`` -> ``B_x``)."""
    return name.rpartition(".")[2]


def local_indices(poses: PoseSet) -> tuple[Array, Array]:
    """Position (P, N) in mm and orientation (P, N) in rad per unit of every parameter."""
    J = pose_jacobians(poses.machine, poses.configuration).parameters
    return np.sqrt(np.sum(J[:, :3] ** 2, axis=1)), np.sqrt(np.sum(J[:, 3:] ** 2, axis=1))


def sensitivity(poses: PoseSet) -> Sensitivity:
    """Global sensitivity over poses that stand for the workspace."""
    machine = poses.machine
    position, orientation = local_indices(poses)
    single = [
        _index(p.name, p.unit, p.says, position[k], orientation[k], p.tolerance)
        for k, p in enumerate(machine.parameters)
    ]
    members: dict[tuple[str, str], list[int]] = {}
    for k, p in enumerate(machine.parameters):
        members.setdefault((kind_of(p.name), p.unit), []).append(k)
    kinds = [
        _index(
            kind,
            unit,
            machine.parameters[held[0]].says,
            np.sqrt(np.sum(position[held] ** 2, axis=0)),
            np.sqrt(np.sum(orientation[held] ** 2, axis=0)),
            max(machine.parameters[k].tolerance for k in held),
        )
        for (kind, unit), held in members.items()
    ]
    sigma = machine.prior_sigma[:, None]
    return Sensitivity(
        parameters=_ranked(single),
        kinds=_ranked(kinds),
        poses=poses.count,
        position_sigma=float(np.sqrt(np.mean(np.sum((sigma * position) ** 2, axis=0)))),
        orientation_sigma=float(np.sqrt(np.mean(np.sum((sigma * orientation) ** 2, axis=0)))),
    )


def _index(
    name: str, unit: str, says: str, position: Array, orientation: Array, tolerance: float
) -> Index:
    return Index(
        name,
        unit,
        says,
        float(np.mean(position)),
        float(np.std(position)),
        float(np.mean(orientation)),
        float(np.std(orientation)),
        tolerance,
    )


def _ranked(indices: Sequence[Index]) -> tuple[Index, ...]:
    return tuple(sorted(indices, key=lambda i: (-i.position_share, -i.orientation_share)))


@dataclass(frozen=True)
class Tolerance:
    """Tolerances (+-, in the unit of the kind) of one kind of error for a wanted pose error.

    ``alone`` if it were the only error (Feng et al. 2022: T = +-3 sigma / lambda); ``shared`` if
    every kind may cause the same. Infinite where the pose does not depend on it.
    """

    kind: str
    unit: str
    alone: float
    shared: float


def tolerances(
    found: Sensitivity, *, position: float | None = None, orientation: float | None = None
) -> tuple[Tolerance, ...]:
    """Tolerances for a wanted standard deviation of position (mm), orientation (rad) or both.

    Where both are wanted the narrower tolerance holds.
    """
    out = []
    for index in found.kinds:
        alone = min(_allowed(position, index.position), _allowed(orientation, index.orientation))
        out.append(Tolerance(index.name, index.unit, alone, alone / np.sqrt(len(found.kinds))))
    return tuple(out)


def _allowed(wanted: float | None, index: float) -> float:
    if wanted is None or index < 1e-15:
        return float("inf")
    return COVERAGE * wanted / index
