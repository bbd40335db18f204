"""The whole path of a plan, checked against all limits before anything moves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.errors import GateRefused
from app.files.pose_table import HOME, Pose
from app.session.plan import Plan
from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.limits import Violation, violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import forward, inverse

BETWEEN = 8
"""Parts into which the way from one waypoint to the next is cut to look at it."""


def waypoints(plan: Plan) -> list[str]:
    """Labels of the poses in the order in which the plan goes to them, home first."""
    path = [HOME]
    for step in plan.steps:
        if step.goal is not None and step.goal != path[-1]:
            path.append(step.goal)
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
    share = np.arange(1, BETWEEN) / BETWEEN
    between = s[:, :-1, None] + (s[:, 1:] - s[:, :-1])[:, :, None] * share
    ways = forward(machine, between.reshape(len(s), -1), parameters)
    for violation in violations(machine, ways, geometry):
        leg = violation.pose // len(share)
        raise _refusal(f"the way from pose {labels[leg]} to pose {labels[leg + 1]}", violation)
    q = machine.coordinates(np.concatenate([s, ways.extension], axis=1), geometry)
    low, high = machine.q_limits.T
    return float(np.min(np.minimum(q - low[:, None], high[:, None] - q)))


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
