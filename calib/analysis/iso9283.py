"""ISO 9283: pose accuracy and repeatability, distance accuracy and repeatability.

Clauses 7.2.1 (AP), 7.2.2 (RP), 7.3.2 (AD) and 7.3.3 (RD) of ISO 9283:1998, for n cycles of the
same commanded poses. Lengths in mm, angles in rad, attained and commanded in the same frame.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput

CYCLES = 30
"""Cycles that the standard asks for."""
MEAN_OF_NORM = float(np.sqrt(8.0 / np.pi))
SPREAD_OF_NORM = float(np.sqrt(3.0 - 8.0 / np.pi))
RP_OF_SIGMA = MEAN_OF_NORM + 3.0 * SPREAD_OF_NORM
"""RP of scatter that is normal with sigma 1 along each axis (Maxwell distribution): 3.616."""


@dataclass(frozen=True, eq=False)
class PoseResult:
    """Accuracy and repeatability at one commanded pose.

    Attributes
    ----------
    cycles : int
    accuracy : float
        AP_P: distance from the commanded position to the barycentre of the attained ones.
    accuracy_xyz : (3,)
        AP_x, AP_y, AP_z: barycentre less command.
    repeatability : float
        RP_l = mean + 3 standard deviations of the distances from the barycentre.
    accuracy_angles, repeatability_angles : (3,), optional
        AP and RP (+-) of rx, ry, rz.
    barycentre : (3,)
    """

    cycles: int
    accuracy: float
    accuracy_xyz: Array
    repeatability: float
    accuracy_angles: Array | None
    repeatability_angles: Array | None
    barycentre: Array


def pose_result(
    command: Array, attained: Array, angles: tuple[Array, Array] | None = None
) -> PoseResult:
    """AP and RP of one pose.

    Parameters
    ----------
    command : (3,)
        Commanded position.
    attained : (3, n)
        Attained positions, one a cycle.
    angles : ((3,), (3, n)), optional
        Commanded and attained rx, ry, rz.

    Raises
    ------
    BadInput
        For fewer than two cycles.
    """
    n = attained.shape[1]
    if n < 2:
        raise BadInput(f"{n} cycle", remedy="Repeatability needs at least two, the standard 30.")
    barycentre = attained.mean(axis=1)
    offset = barycentre - command
    distance = np.sqrt(np.sum((attained - barycentre[:, None]) ** 2, axis=0))
    turned = spread = None
    if angles is not None:
        wanted, reached = angles
        # Differences from the command, so that an angle near 180 deg does not jump.
        away = (reached - wanted[:, None] + np.pi) % (2.0 * np.pi) - np.pi
        turned, spread = away.mean(axis=1), 3.0 * away.std(axis=1, ddof=1)
    return PoseResult(
        cycles=n,
        accuracy=float(np.linalg.norm(offset)),
        accuracy_xyz=offset,
        repeatability=float(distance.mean() + 3.0 * distance.std(ddof=1)),
        accuracy_angles=turned,
        repeatability_angles=spread,
        barycentre=barycentre,
    )


@dataclass(frozen=True, eq=False)
class DistanceResult:
    """Accuracy and repeatability of the distance between two commanded poses.

    ``accuracy`` AD = mean attained distance less commanded; ``accuracy_xyz`` the same of the
    components' magnitudes; ``repeatability`` RD (+-) = 3 standard deviations of the distance.
    ``allowed`` is the RD that the repeatabilities of the two poses lead one to expect.
    """

    cycles: int
    commanded: float
    accuracy: float
    accuracy_xyz: Array
    repeatability: float
    repeatability_xyz: Array
    allowed: float


def distance_result(commands: tuple[Array, Array], attained: tuple[Array, Array]) -> DistanceResult:
    """AD and RD of a pair of poses.

    Parameters
    ----------
    commands : two (3,)
    attained : two (3, n)
        Attained positions; column j of both belongs to the same cycle.
    """
    first, second = attained
    n = first.shape[1]
    if n < 2 or second.shape[1] != n:
        raise BadInput(
            f"{n} and {second.shape[1]} cycles of a pair",
            remedy="A distance needs both poses in the same cycles, at least two.",
        )
    asked, reached = np.abs(commands[1] - commands[0]), np.abs(second - first)
    length = np.sqrt(np.sum((second - first) ** 2, axis=0))
    commanded = float(np.linalg.norm(commands[1] - commands[0]))
    return DistanceResult(
        cycles=n,
        commanded=commanded,
        accuracy=float(length.mean() - commanded),
        accuracy_xyz=reached.mean(axis=1) - asked,
        repeatability=float(3.0 * length.std(ddof=1)),
        repeatability_xyz=3.0 * reached.std(axis=1, ddof=1),
        allowed=implied_distance_repeatability(
            pose_result(commands[0], first).repeatability,
            pose_result(commands[1], second).repeatability,
        ),
    )


def implied_distance_repeatability(first: float, second: float) -> float:
    """RD that two poses of repeatability RP lead one to expect.

    Scatter that is normal and equal in all directions has RP = 3.616 sigma, and the distance of
    two such points scatters with sqrt(sigma_1^2 + sigma_2^2) along the line between them. An RD
    many times this large mixes different pairs, or poses that moved between the cycles.
    """
    return 3.0 * float(np.hypot(first, second)) / RP_OF_SIGMA
