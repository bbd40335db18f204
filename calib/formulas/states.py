"""What a formula may name of the machine's state at each reading.

The pose, the forces and the points of base and platform are those that were commanded, of the
nominal machine: what an effect is a function of needs no more, and does not change under a fit.
"""

from collections.abc import Callable, Iterable
from functools import lru_cache

import numpy as np

from calib.arrays import Array, IntArray
from calib.effects.gravity_sag import weight_wrench, weightless
from calib.effects.link_weight import link_forces
from calib.formulas.functions import OWN, POINT, POSE
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import rotate, to_euler
from calib.mechanism.solve import Configuration, forward
from calib.runs.stack import Rows


@lru_cache(maxsize=4)
def _commanded(rows: Rows) -> tuple[Configuration, IntArray]:
    """The nominal machine at its distinct states, and the state (N,) of each reading."""
    states, which = np.unique(rows.extension, axis=1, return_inverse=True)
    return forward(rows.machine, states), np.asarray(which, dtype=np.intp).reshape(-1)


def pose_states(rows: Rows) -> dict[str, Array]:
    """Commanded pose (N,) of the platform in the base frame, mm and rad."""
    closed, which = _commanded(rows)
    values = np.concatenate([closed.poses.position, to_euler(closed.poses.rotation)])
    values = np.where(closed.converged, values, np.nan)
    return dict(zip(POSE, values[:, which], strict=True))


def base_points(rows: Rows) -> Array:
    """Where the SMR was commanded to be in the base frame, (3, N)."""
    closed, which = _commanded(rows)
    rotation = closed.poses.rotation[:, :, which]
    on = closed.poses.position[:, which] + rotate(rotation, rows.nest)
    return np.where(rows.on_platform, on, rows.nest)


def forces(rows: Rows) -> Array:
    """Force (N, + tension) or torque (N mm) of the weight in each actuator, (n, N)."""
    closed, which = _commanded(rows)
    twists = pose_jacobians(rows.machine, closed).actuators[:, :, which]
    force, moment = weight_wrench(rows, closed.poses.rotation[:, :, which])
    along = np.einsum("icr,cr->ir", twists[:, :3], force)
    along += np.einsum("icr,cr->ir", twists[:, 3:], moment)
    return np.asarray(along + link_forces(rows))


def ways(rows: Rows) -> Array:
    """Way that each actuator has gone since its run began, back and forth, (n, N)."""
    change = np.abs(rows.path.change)
    gone = rows.path.carry(np.zeros_like(change), lambda way, row: way + change[:, row])
    return np.asarray(gone[:, rows.at])


def since_motion(rows: Rows) -> Array:
    """Seconds since the row at which each actuator last moved, or since the run began, (n, N)."""
    path = rows.path
    begin = np.broadcast_to(path.time_s, path.change.shape)
    last = path.carry(
        begin,
        lambda time, row: np.where(path.change[:, row] != 0.0, path.time_s[row], time),
    )
    return np.asarray((path.time_s - last)[:, rows.at])


def own_states(rows: Rows, names: Iterable[str]) -> dict[str, Array]:
    """State of each actuator (n, N) by name, of :data:`OWN`; only what is asked for."""
    made: dict[str, Callable[[], Array]] = {
        "s": lambda: rows.extension,
        "q": lambda: rows.q,
        "l": lambda: rows.machine.coordinates(rows.extension),
        "direction": lambda: rows.direction,
        "step": lambda: rows.step,
        "force": lambda: forces(rows),
        "way": lambda: ways(rows),
        "since": lambda: since_motion(rows),
    }
    assert set(made) == set(OWN)
    return {name: np.asarray(made[name]()) for name in names}


def point_states(rows: Rows, point: Array, frame: str) -> dict[str, Array]:
    """State of the point that is read (N,), by name, of :data:`POINT`.

    ``x``, ``y``, ``z`` in ``frame``: of the tracker, where the point was read, else as commanded.
    """
    x, y, z = point if frame == "tracker" else rows.nest
    if frame == "base":
        x, y, z = base_points(rows)
    ranges, ground = np.sqrt(np.sum(point**2, axis=0)), np.hypot(point[0], point[1])
    beam = (ranges, np.arctan2(point[1], point[0]), np.arctan2(point[2], ground))
    return dict(zip(POINT, (x, y, z, *beam), strict=True))


def without_force(rows: Rows) -> str:
    """Say why no actuator's force is known; empty if they are."""
    return weightless(rows)
