"""From the pose that is wanted to the extensions that are commanded."""

import numpy as np

from app.hosted.parameters import ParameterSet
from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.limits import violations
from calib.mechanism.solve import inverse
from drivers.errors import Refused


def commanded_extension(
    machine: Machine, chosen: ParameterSet, pose: tuple[float, ...], device: str
) -> Array:
    """Extensions (n,), mm or rad, that bring the platform to a pose.

    Parameters
    ----------
    pose : tuple of float
        Task coordinates, mm and rad.

    Raises
    ------
    Refused
        For what is no pose, cannot be reached, or passes a limit.
    """
    wanted = len(machine.task.coordinates)
    if len(pose) != wanted or not np.all(np.isfinite(pose)):
        raise Refused(
            f"{pose} is no pose: {wanted} finite numbers are", device=device, remedy="Command one"
        )
    parameters = machine.vector(chosen.values)
    closed = inverse(machine, np.array(pose, float)[:, None], parameters)
    for violation in violations(machine, closed):
        raise Refused(
            f"the pose passes a limit: {violation.what}"
            + (f" = {violation.value:.4g} {violation.unit}" if violation.unit else ""),
            device=device,
            remedy="Choose another pose",
        )
    extension: Array = closed.extension[:, 0]
    return extension
