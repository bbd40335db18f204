"""An unguided screw on the Stewart platform, written out: its legs twist as their joints swing.

The mock has no such machine, so the record is changed: the platform stands where the lengths that
are written put it; a controller that knows nothing of the twist commanded them without it.
"""

import tomllib
from functools import cache
from importlib.resources import files

import numpy as np

Vector = np.ndarray


@cache
def geometry() -> tuple[Vector, Vector, float]:
    """Base and platform joints (3, 6), and the height at home, of the shipped machine file."""
    table = tomllib.loads(files("calib.machines").joinpath("stewart.toml").read_text())
    legs = table["limbs"].values()
    base = np.array([[leg["B_x"], leg["B_y"], 0.0] for leg in legs]).T
    head = np.array([[leg["P_x"], leg["P_y"], 0.0] for leg in legs]).T
    return base, head, float(table["home"]["pose"]["z"])


def turned(angles: Vector) -> Vector:
    """R = Rz(rz) Ry(ry) Rx(rx), (3, 3)."""
    (a, b, c), (d, e, f) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [b * c, d * e * c - a * f, a * e * c + d * f],
            [b * f, d * e * f + a * c, a * e * f - d * c],
            [-e, d * b, a * b],
        ]
    )


def legs(pose: Vector) -> Vector:
    """Vectors (3, 6) from the base joints to the platform's."""
    base, head, _ = geometry()
    return np.asarray(pose[:3, None] + turned(pose[3:]) @ head - base)


def pose_of(lengths: Vector) -> Vector:
    """Pose (6,) at which the legs have these lengths, by Newton from home."""
    pose = np.array([0.0, 0.0, geometry()[2], 0.0, 0.0, 0.0])
    for _ in range(20):
        off = np.linalg.norm(legs(pose), axis=0) - lengths
        steps = np.diag([1e-4] * 3 + [1e-6] * 3)
        slopes = [
            (np.linalg.norm(legs(pose + h), axis=0) - np.linalg.norm(legs(pose - h), axis=0))
            / (2.0 * h.sum())
            for h in steps
        ]
        pose = pose - np.linalg.solve(np.array(slopes).T, off)
    return pose


def twists(pose: Vector) -> Vector:
    """Turn (6,) of each leg about itself, from its lower cross pin to its upper one."""
    along = legs(pose) / np.linalg.norm(legs(pose), axis=0)
    lower = np.cross(along.T, [1.0, 0.0, 0.0])
    upper = np.cross(along.T, np.cross(turned(pose[3:])[:, 1], along.T))
    sine = np.einsum("ni,ni->n", along.T, np.cross(lower, upper))
    return np.arctan2(sine, np.einsum("ni,ni->n", lower, upper))


def commanded(lengths: Vector, lead: float) -> Vector:
    """Lengths (6,) that were commanded where screws of a lead of ``lead`` mm made ``lengths``."""
    home = np.array([0.0, 0.0, geometry()[2], 0.0, 0.0, 0.0])
    turns = (twists(pose_of(lengths)) - twists(home)) / (2.0 * np.pi)
    return np.asarray(lengths - lead * turns)
