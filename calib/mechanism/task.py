"""The coordinates of the pose that a machine commands: all six, a position, or a direction."""

import numpy as np

from calib.arrays import Array, Numbers
from calib.mechanism.description import Task
from calib.mechanism.rigid import (
    Poses,
    euler_rates,
    exponential,
    from_euler,
    product,
    small_rotation,
    to_euler,
)

_POSITION = {"x": 0, "y": 1, "z": 2}
_ANGLE = {"rx": 0, "ry": 1, "rz": 2}
FULL = ("x", "y", "z", "rx", "ry", "rz")


def task_values(task: Task, poses: Poses) -> Array:
    """Task coordinates (n, N) of poses, in the task's own order; mm and rad."""
    angles = to_euler(poses.rotation)
    z_axis = poses.rotation[:, 2]
    values = {
        "tilt": np.arctan2(np.hypot(z_axis[0], z_axis[1]), z_axis[2]),
        "azimuth": np.arctan2(z_axis[1], z_axis[0]),
    }
    values |= {name: poses.position[i] for name, i in _POSITION.items()}
    values |= {name: angles[i] for name, i in _ANGLE.items()}
    return np.stack([values[name] for name in task.coordinates])


def task_error(task: Task, target: Numbers, position: Numbers, rotation: Numbers) -> Numbers:
    """What is left to move, (n, N): target (n, N) less the present pose, to first order.

    A full orientation is left as a rotation vector, a direction as the x and y components of the
    z axis, anything else as a difference of coordinates; :func:`task_rows` goes with it.
    """
    if task.coordinates == FULL:
        goal = from_euler(*target[3:])
        return np.concatenate([target[:3] - position, small_rotation(rotation, goal)])
    values = dict(zip(task.coordinates, target, strict=True))
    out = []
    for name in task.coordinates:
        if name in _POSITION:
            out.append(values[name] - position[_POSITION[name]])
        elif name in _ANGLE:
            angle = to_euler(np.real(rotation))[_ANGLE[name]]
            out.append((values[name] - angle + np.pi) % (2.0 * np.pi) - np.pi)
        else:
            swing = np.cos if name == "tilt" else np.sin
            component = np.sin(values["tilt"]) * swing(values["azimuth"])
            out.append(component - rotation[0 if name == "tilt" else 1, 2])
    return np.stack(out)


def task_moved(task: Task, target: Array, by: Array) -> Array:
    """Task coordinates (n, N) beside ``target``: :func:`task_error` from there to them is ``by``.

    Where a direction is moved to more than a quarter turn from z there are none: nan.
    """
    if task.coordinates == FULL:
        turned = product(exponential(by[3:]), from_euler(*target[3:]))
        return np.concatenate([target[:3] + by[:3], to_euler(turned)])
    moved = target + by
    index = {name: i for i, name in enumerate(task.coordinates)}
    if "tilt" in index:
        tilt, azimuth = index["tilt"], index["azimuth"]
        level = np.sin(target[tilt])
        x = level * np.cos(target[azimuth]) + by[tilt]
        y = level * np.sin(target[azimuth]) + by[azimuth]
        with np.errstate(invalid="ignore"):
            moved[tilt], moved[azimuth] = np.arcsin(np.hypot(x, y)), np.arctan2(y, x)
    return np.asarray(moved)


def task_rows(task: Task, rotation: Numbers) -> Numbers:
    """Matrix T (n, 6, N): change of :func:`task_error`'s coordinates for a twist [v; omega]."""
    count = rotation.shape[-1]
    rows = np.zeros((len(task.coordinates), 6, count), dtype=rotation.dtype)
    if task.coordinates == FULL:
        rows[:] = np.eye(6)[:, :, None]
        return rows
    rates = None
    x, y, z = rotation[:, 2]
    for i, name in enumerate(task.coordinates):
        if name in _POSITION:
            rows[i, _POSITION[name]] = 1.0
        elif name in _ANGLE:
            rates = euler_rates(np.real(rotation)) if rates is None else rates
            rows[i, 3:] = rates[_ANGLE[name]]
        elif name == "tilt":
            rows[i, 4], rows[i, 5] = z, -y
        else:
            rows[i, 3], rows[i, 5] = -z, x
    return rows
