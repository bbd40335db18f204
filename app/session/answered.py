"""Actuator values that a controller answers: can they be, and do they belong to the pose?

They stand in the run, and a serial line has no checksum: a digit that became another on its way is
noticed here, or not at all. The host computes the same with the parameters that it has read.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from app.files.pose_table import Pose
from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse
from drivers.errors import ProtocolError

OFF_MM, OFF_RAD = 2.0, 0.05
"""Farther from the host's own value a target is none of that pose. Controllers that compensate
something in their targets stay well below."""
REMEDY = "Check cable and controller, then go on: the pose is commanded anew"


def must_be_within_reach(
    machine: Machine, q: Sequence[float], homed: Sequence[bool] | None = None
) -> None:
    """Refuse actuator values (mm, rad) farther outside the stroke than the stroke is long.

    An actuator that was driven past its limits by hand is no more than that; one that has not been
    ``homed`` counts from wherever it was switched on.

    Raises
    ------
    ProtocolError
    """
    low, high = machine.q_limits.T
    stroke = high - low
    inside = (np.array(q) >= low - stroke) & (np.array(q) <= high + stroke)
    if homed is not None:
        inside |= ~np.array(homed)
    for actuator, value, good in zip(machine.actuators, q, inside, strict=True):
        if not good:
            raise ProtocolError(
                f"answers {value:g} {actuator.unit} for {actuator.name}, where "
                f"{actuator.limits[0]:g} to {actuator.limits[1]:g} is its stroke",
                device="controller",
                remedy=REMEDY,
            )


def must_belong(
    machine: Machine, controller: Mapping[str, float], pose: Pose, q: Sequence[float]
) -> None:
    """Refuse targets that are not those of a commanded pose.

    Parameters
    ----------
    controller : mapping
        The parameters that the controller holds.
    pose : six numbers
    q : sequence of float
        Its targets, in the order of the machine's actuators; mm, rad.

    Raises
    ------
    ProtocolError
    """
    must_be_within_reach(machine, q)
    own = expected_targets(machine, controller, pose)
    for actuator, answered, wanted in zip(machine.actuators, q, own, strict=True):
        most = OFF_RAD if actuator.unit == "rad" else OFF_MM
        if abs(answered - wanted) > most:
            raise ProtocolError(
                f"answers {answered:.6g} {actuator.unit} as the target of {actuator.name}, where "
                f"this pose needs {wanted:.6g}",
                device="controller",
                remedy=REMEDY,
            )


def expected_targets(machine: Machine, controller: Mapping[str, float], pose: Pose) -> Array:
    """Actuator values (n,) of a pose with the controller's parameters, as the host computes."""
    geometry = {name: v for name, v in controller.items() if name in machine.parameter_index}
    at = Poses.from_xyz_rpy(np.array(pose, float)[:, None])
    extension = inverse(machine, at, machine.vector(geometry)).extension
    return machine.coordinates(extension, geometry)[:, 0]
