"""First guess of the base frame in the tracker frame: rigid alignment of the nests.

Readings that do not fit the majority are left out: they are tried against random triples of
readings.
"""

from functools import lru_cache

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.frames import align

TRIPLES = 400
LEAST_MOVED = 6
"""Readings that must fit one another before they are said to have moved as one."""


def misfit(base: Array, tracker: Array, rotation: Array, position: Array) -> Array:
    """Distance (N,) between tracker points and aligned base points, mm."""
    apart = tracker - rotation @ base - position[:, None]
    return np.asarray(np.sqrt(np.sum(apart * apart, axis=0)))


def collinear(points: Array) -> bool:
    """Tell whether points (3, N) lie on a line, so that they cannot tie a frame."""
    if points.shape[1] < 3:
        return True
    spread = np.linalg.svd(points - points.mean(axis=1)[:, None], compute_uv=False)
    return bool(spread[1] < 1e-3 * spread[0] or spread[0] == 0.0)


def robust_align(base: Array, tracker: Array, slack: Array) -> tuple[Array, Array, BoolArray]:
    """Align while readings that cannot be right are left out.

    Parameters
    ----------
    base, tracker : (3, N)
        Expected points, and what was read.
    slack : (N,)
        How far apart, in mm, a good pair may be.

    Returns
    -------
    rotation (3, 3), position (3,), inside (N,) bool
    """
    rotation, position = align(base, tracker)
    inside = misfit(base, tracker, rotation, position) < slack
    if inside.all():
        return rotation, position, inside
    trials = np.concatenate([inside[None], _trials(base, tracker, slack)])
    best = trials[np.argmax(trials.sum(axis=1))]
    for _ in range(5):
        if best.sum() < 3:
            break
        rotation, position = align(base[:, best], tracker[:, best])
        again = misfit(base, tracker, rotation, position) < slack
        if np.array_equal(again, best):
            break
        best = again
    return rotation, position, best


def _trials(base: Array, tracker: Array, slack: Array) -> BoolArray:
    """Readings (T, N) inside after aligning each of T random triples that are on no line."""
    three = _triples(base.shape[1])
    points, seen = np.moveaxis(base[:, three], 0, 1), np.moveaxis(tracker[:, three], 0, 1)
    centre, seen_centre = points.mean(axis=2), seen.mean(axis=2)
    points = points - centre[:, :, None]
    spread = np.linalg.svd(points, compute_uv=False)
    plane = (spread[:, 1] >= 1e-3 * spread[:, 0]) & (spread[:, 0] > 0.0)
    u, _, vt = np.linalg.svd((seen - seen_centre[:, :, None]) @ np.swapaxes(points, 1, 2))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    rotation = u @ vt
    apart = tracker - rotation @ (base - centre[:, :, None]) - seen_centre[:, :, None]
    return np.asarray(np.sum(apart * apart, axis=1)[plane] < slack**2)


@lru_cache(maxsize=256)
def _triples(count: int) -> IntArray:
    """Random triples (T, 3) of so many readings; the same every time: a fit is a pure function."""
    generator = np.random.default_rng(0)
    three = np.array([generator.choice(count, 3, replace=False) for _ in range(TRIPLES)])
    three.setflags(write=False)
    return three


def moved_together(base: Array, tracker: Array, slack: Array) -> BoolArray:
    """Readings (N,) outside that fit one another: not strays, the tracker or the base was moved.

    Shapes as in :func:`robust_align`; none is marked where fewer than six fit, or less than half.
    """
    count = base.shape[1]
    if count < LEAST_MOVED or collinear(base):
        return np.zeros(count, dtype=bool)
    _, _, inside = robust_align(base, tracker, slack)
    enough = inside.sum() >= max(LEAST_MOVED, 0.5 * count)
    return inside if enough else np.zeros(count, dtype=bool)
