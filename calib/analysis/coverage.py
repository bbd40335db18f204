"""Poses that stand for the whole workspace."""

import numpy as np

from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.poses.reach import PoseSet, reachable, rounded, sample_poses, solve_poses, workspace_box

POINTING_STEP = float(np.deg2rad(10.0))
"""Zhang et al. 2018, section 4: the workspace is divided by 10 deg in tilt and azimuth."""


def workspace_poses(machine: Machine, count: int, generator: np.random.Generator) -> PoseSet:
    """Poses over the workspace: random and uniform, or a pointing machine's grid of directions.

    The grid has one pose at tilt zero and every 10 deg beyond: 217 poses for 60 deg of tilt, as in
    Zhang et al. 2018. Poses that cannot be reached are left out.

    Parameters
    ----------
    machine : Machine
    count : int
        Number of random poses; a pointing machine's grid has its own.
    generator : numpy Generator
    """
    if not machine.task.pointing:
        return sample_poses(machine, count, generator)
    low, high = (
        dict(zip(machine.task.coordinates, b, strict=True)) for b in workspace_box(machine)
    )
    tilts = np.arange(low["tilt"], high["tilt"] + 1e-9, POINTING_STEP)
    azimuths = np.arange(low["azimuth"], high["azimuth"] - 1e-9, POINTING_STEP)
    pairs = [
        {"tilt": tilt, "azimuth": azimuth}
        for tilt in tilts
        for azimuth in (azimuths if tilt > 1e-9 else azimuths[:1])
    ]
    task = np.array([[pair[name] for name in machine.task.coordinates] for pair in pairs]).T
    found = solve_poses(machine, rounded(machine, task))
    found = found.take(reachable(machine, found.configuration))
    if not found.count:
        raise BadInput(
            "no direction of the workspace can be reached",
            place=machine.source,
            remedy="Widen the limits of actuators and joints, or narrow [workspace].",
        )
    return found
