"""The whole path of a plan, checked against all limits before anything moves."""

from collections.abc import Mapping, Sequence

import numpy as np

from app.errors import GateRefused
from app.session.plan import Plan, Pose
from app.session.work import HOME
from calib.mechanism.description import Machine
from calib.mechanism.limits import violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse

BETWEEN = 8
"""Poses looked at from one waypoint to the next, the arrival included."""


def waypoints(plan: Plan) -> list[str]:
    """Labels of the poses in the order in which the plan goes to them, home first."""
    path = [HOME]
    for step in plan.steps:
        label = step.args["pose"] if step.kind in ("move", "read") else None
        label = HOME if step.kind in ("home", "confirm") else label
        if label is not None and label != path[-1]:
            path.append(label)
    return path


def check_waypoints(
    machine: Machine,
    controller: Mapping[str, float],
    path: Sequence[Pose],
    labels: Sequence[str],
) -> float:
    """Check poses and the straight way between them with the controller's own parameters.

    Returns the smallest distance to an actuator limit over the path, in the actuators' unit.

    Raises
    ------
    GateRefused
        Naming the first pose that passes a limit, which one, and by how much.
    """
    ends = np.array(path, float).T
    share = np.arange(1, BETWEEN + 1) / BETWEEN
    ways = ends[:, :-1, None] + (ends[:, 1:] - ends[:, :-1])[:, :, None] * share
    poses = np.concatenate([ends[:, :1], ways.reshape(6, -1)], axis=1)
    geometry = {name: v for name, v in controller.items() if name in machine.parameter_index}
    found = inverse(machine, Poses.from_xyz_rpy(poses), machine.vector(geometry))
    for violation in violations(machine, found, geometry):
        leg, part = divmod(max(violation.pose - 1, 0), BETWEEN)
        at_pose = violation.pose == 0 or part == BETWEEN - 1
        end = labels[leg + 1] if violation.pose else labels[0]
        where = f"pose {end}" if at_pose else f"the way from pose {labels[leg]} to pose {end}"
        raise GateRefused(
            f"{where} passes a limit: {violation.what}"
            + (
                f" = {violation.value:.3f} {violation.unit}, allowed "
                f"{violation.low:.3f}..{violation.high:.3f}"
                if np.isfinite(violation.value)
                else ""
            ),
            remedy="Leave that pose out or choose poses with pkmcal poses; nothing has moved",
        )
    q = machine.coordinates(found.extension, geometry)
    low, high = machine.q_limits.T
    return float(np.min(np.minimum(q - low[:, None], high[:, None] - q)))
