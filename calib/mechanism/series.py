"""Series about home as flat numbers, with which the compiled core begins (core/job.h)."""

import numpy as np

from calib.arrays import Array
from calib.mechanism.configuration import Configuration
from calib.mechanism.description import Machine
from calib.mechanism.extrapolate import Extrapolation, coefficients, pose_probes
from calib.mechanism.kernel import Kernel
from calib.mechanism.tables import actuator_units, passive_units


def forward_numbers(home: Configuration, series: Extrapolation) -> Array:
    """What :meth:`Extrapolation.guess` needs, after what home is."""
    return _numbers(home, 1.0 / series.unit[:, 0], series.linear, series.quadratic)


def inverse_numbers(machine: Machine, kernel: Kernel, home: Configuration) -> Array | None:
    """Passive coordinates and extensions as a series in the pose; None where it does not close."""
    steps, poses = pose_probes(home.poses, machine.size)
    near = kernel.solve(machine.nominal, None, poses.position, poses.rotation.reshape(9, -1), home)
    if not (home.converged[0] and near.converged.all()):
        return None
    y = np.concatenate([near.passive - home.passive, near.extension - home.extension])
    units = np.concatenate([passive_units(machine), actuator_units(machine)])
    return _numbers(home, 1.0 / units, *coefficients(steps, y))


def _numbers(home: Configuration, per_unit: Array, linear: Array, quadratic: Array) -> Array:
    at = (home.poses.position, home.poses.rotation, home.passive, home.extension, *home.strain)
    return np.concatenate([np.ravel(a) for a in (*at, per_unit, linear, quadratic)])
