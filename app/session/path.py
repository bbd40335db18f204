"""The whole path of a plan, checked against all limits before anything moves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.errors import GateRefused
from app.files.pose_table import HOME, Pose
from app.session.plan import Plan
from calib.arrays import Array, IntArray
from calib.mechanism.description import Machine
from calib.mechanism.limits import Violation, violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import Configuration, forward, inverse

BETWEEN, FINE = 8, 64
"""Parts into which the way from one waypoint to the next is cut to look at it, and where a joint
bends so much on it that it may pass a limit between two of them."""


def waypoints(plan: Plan) -> list[str]:
    """Labels of the poses in the order in which the plan goes to them, home first."""
    path = [HOME]
    for step in plan.steps:
        for label in step.way:
            if label != path[-1]:
                path.append(label)
    return path


def check_waypoints(
    machine: Machine,
    controller: Mapping[str, float],
    path: Sequence[Pose],
    labels: Sequence[str],
    sent: Array | None = None,
) -> float:
    """Check poses and the ways between them with the controller's own parameters.

    A controller moves its actuators together and linearly, so a way is straight in actuator
    space. Returns the smallest distance to an actuator limit over the path, in its unit.

    Parameters
    ----------
    sent : (n, N), optional
        Extensions that the host will command for these poses, everything compensated, where it
        computes the motion; they refer to the drawing.

    Raises
    ------
    GateRefused
        Naming the first pose that passes a limit, which one, and by how much.
    """
    geometry = {name: v for name, v in controller.items() if name in machine.parameter_index}
    parameters = machine.vector(geometry)
    ends = inverse(machine, Poses.from_xyz_rpy(np.array(path, float).T), parameters)
    if sent is not None:
        ends, geometry = replace(ends, extension=sent), {}
    for violation in violations(machine, ends, geometry):
        raise _refusal(f"pose {labels[violation.pose]}", violation)
    s = ends.extension
    ways = _ways(machine, s[:, :-1], s[:, 1:], parameters, BETWEEN)
    first = next(iter(violations(machine, ways, geometry)), None)
    leg = first.pose // (BETWEEN + 1) if first else 0
    if first is None and (near := _near_a_limit(machine, ways)).size:
        fine = _ways(machine, s[:, near], s[:, near + 1], parameters, FINE)
        first = next(iter(violations(machine, fine, geometry)), None)
        leg = int(near[first.pose // (FINE + 1)]) if first else 0
    if first is not None:
        raise _refusal(f"the way from pose {labels[leg]} to pose {labels[leg + 1]}", first)
    q = machine.coordinates(np.concatenate([s, ways.extension], axis=1), geometry)
    low, high = machine.q_limits.T
    return float(np.min(np.minimum(q - low[:, None], high[:, None] - q)))


def _ways(
    machine: Machine, begin: Array, end: Array, parameters: Array, parts: int
) -> Configuration:
    """Ways (n, W) -> (n, W), straight for the actuators, cut into parts: W * (parts + 1) places."""
    share = np.linspace(0.0, 1.0, parts + 1)
    places = begin[:, :, None] + (end - begin)[:, :, None] * share
    return forward(machine, places.reshape(len(begin), -1), parameters)


def _near_a_limit(machine: Machine, ways: Configuration) -> IntArray:
    """Ways on which a joint may pass a limit between two places: by how it bends there."""
    joints = ways.passive.reshape(len(machine.joints), -1, BETWEEN + 1)
    if not joints.size:
        return np.zeros(0, dtype=np.intp)
    bend = np.abs(np.diff(joints, 2, axis=2)).max(axis=2)
    low, high = np.array([joint.limits for joint in machine.joints]).T[:, :, None]
    over = (joints.max(axis=2) + bend > high) | (joints.min(axis=2) - bend < low)
    return np.flatnonzero(over.any(axis=0))


def _refusal(where: str, violation: Violation) -> GateRefused:
    value = (
        f" = {violation.value:.3f} {violation.unit}, allowed "
        f"{violation.low:.3f}..{violation.high:.3f}"
        if np.isfinite(violation.value)
        else ""
    )
    return GateRefused(
        f"{where} passes a limit: {violation.what}{value}",
        remedy="Leave that pose out or choose poses with pkmcal poses; nothing has moved",
    )
