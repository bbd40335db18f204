"""The tripod's platform when its parallelograms are not: six elastic long sides and their hinges.

Six long sides alone leave the rotation about O O' free. The hinges keep the lower short side in
the plane of its parallelogram; they are kappa c^2 times as stiff, per limb, as a long side is
(docs/papers.md). The platform rests where

    sum over sides (|w| - h)^2 + (kappa / 2) c^2 phi^2

is smallest, less the work of the weight. w is the vector of a side from slider to platform, phi
the angle by which the lower short side x' leaves the plane of the slider's axis o and w:
sin phi = -o . (x' x w) / |x' x w|. mm and rad.
"""

from dataclasses import dataclass

import numpy as np

from mocks.physics.pose import Array, Pose, rotation_from_vector
from mocks.physics.tripod import B_MM, TripodGeometry

SHORT_SIDE_MM = 150.0
KAPPA = 0.01
MOST_STEPS = 12
CLOSED = 1e-11


@dataclass(frozen=True)
class Sides:
    """Six sides at N instants: limb by limb, side 1 (towards the middle) before side 2.

    ``along``, ``across_platform`` (6, 3): slider's axis, and lower short side in the platform
    frame; ``joint`` (6, 3): lower end in the platform frame; ``upper`` (N, 6, 3): upper end;
    ``length`` (N, 6).
    """

    along: Array
    across_platform: Array
    joint: Array
    upper: Array
    length: Array


def sides(g: TripodGeometry, places: Array, h: Array, difference: Array, azimuth: Array) -> Sides:
    """Sides for sliders at ``places`` (N, 3), long sides ``h`` (N, 3) mm on average.

    ``difference`` (3,) mm: side 1 less side 2; ``azimuth`` (3,) rad: platform joint's less
    slider's.
    """
    turned = g.theta + azimuth
    below = np.stack([np.cos(turned), np.sin(turned), np.zeros(3)], axis=1)
    offset = np.tile([-0.5, 0.5], 3) * SHORT_SIDE_MM
    along, across = np.repeat(g.along, 2, axis=0), np.repeat(below, 2, axis=0)
    longer = np.tile([0.5, -0.5], 3) * np.repeat(difference, 2)
    return Sides(
        along=along,
        across_platform=across,
        joint=(B_MM + offset)[:, None] * across,
        upper=(np.repeat(places, 2, axis=1) + offset)[:, :, None] * along,
        length=np.repeat(h, 2, axis=1) + longer,
    )


def _rows(s: Sides, pose: Pose) -> tuple[Array, Array]:
    """Residuals (N, 12) in mm and their derivatives (N, 12, 6) by [t; rotation vector]."""
    arm = np.einsum("nij,kj->nki", pose.rotation, s.joint)
    short = np.einsum("nij,kj->nki", pose.rotation, s.across_platform)
    w = pose.position[:, None, :] + arm - s.upper
    length = np.linalg.norm(w, axis=2)
    u = w / length[:, :, None]
    stretched = np.concatenate([u, np.cross(arm, u)], axis=2)
    normal = np.cross(short, w)
    size = np.linalg.norm(normal, axis=2)[:, :, None]
    unit = normal / size
    sine = -np.sum(s.along * unit, axis=2)
    # d(sin phi) = -o . (1 - m m^T) d(x' x w) / |x' x w|,  d(x' x w) = dx' x w + x' x dw
    g = -(s.along + sine[:, :, None] * unit) / size
    by_w = np.cross(g, short)
    by_turn = np.cross(short, np.cross(w, g)) + np.cross(arm, by_w)
    stiff = np.sqrt(0.5 * KAPPA) * SHORT_SIDE_MM
    bent = stiff * np.concatenate([by_w, by_turn], axis=2) / np.sqrt(1.0 - sine**2)[:, :, None]
    residual = np.concatenate([length - s.length, stiff * np.arcsin(sine)], axis=1)
    return residual, np.concatenate([stretched, bent], axis=1)


def settle(s: Sides, start: Pose, compliance: float, wrench: Array) -> Pose:
    """Where the platform rests, from ``start`` (N poses).

    ``compliance`` of a long side in mm/N; ``wrench`` (N, 6): force in N and moment in N mm about
    the platform's origin, base axes. Raises ArithmeticError if it comes to no rest.
    """
    pose = start
    for _ in range(MOST_STEPS):
        residual, rows = _rows(s, pose)
        columns = rows.transpose(0, 2, 1)
        pull = compliance * wrench - np.einsum("nij,nj->ni", columns, residual)
        step = np.linalg.solve(columns @ rows, pull[:, :, None])[:, :, 0]
        turn = rotation_from_vector(step[:, 3:])
        pose = Pose(pose.position + step[:, :3], turn @ pose.rotation)
        if float(np.max(np.abs(step), initial=0.0)) < CLOSED:
            return pose
    raise ArithmeticError(f"the platform does not come to rest: {np.max(np.abs(step)):.3g} is left")
