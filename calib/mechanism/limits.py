"""Which configurations a machine can really take up: strokes and joint ranges."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray
from calib.mechanism.description import Machine
from calib.mechanism.solve import Configuration


@dataclass(frozen=True)
class Violation:
    """One pose outside one limit: ``value`` and limits in mm or rad."""

    pose: int
    what: str
    value: float
    low: float
    high: float
    unit: str


def _excess(values: Array, low: Array, high: Array) -> BoolArray:
    return (values < low[:, None]) | (values > high[:, None]) | ~np.isfinite(values)


def within_limits(
    machine: Machine, configuration: Configuration, controller: Mapping[str, float] | None = None
) -> BoolArray:
    """Whether each configuration closes within strokes and joint limits, shape (N,).

    ``controller`` holds the controller's own parameters, to which the actuators refer.
    """
    q = machine.coordinates(configuration.extension, controller)
    low, high = _joint_limits(machine)
    inside: BoolArray = configuration.converged & machine.within_stroke(q)
    inside &= ~np.any(_excess(configuration.passive, low, high), axis=0)
    return inside


def violations(
    machine: Machine, configuration: Configuration, controller: Mapping[str, float] | None = None
) -> list[Violation]:
    """Every limit that is passed, pose by pose; a pose that does not close is one violation."""
    found = [
        Violation(int(i), "the pose cannot be reached: the limbs do not close", np.nan, 0, 0, "")
        for i in np.flatnonzero(~configuration.converged)
    ]
    q = machine.coordinates(configuration.extension, controller)
    names = [a.name for a in machine.actuators]
    units = [a.unit for a in machine.actuators]
    low, high = machine.q_limits.T
    found += _named(q, low, high, names, units, configuration.converged)
    names = [f"{limb.name}.{joint.name}" for limb in machine.limbs for joint in limb.joints]
    units = ["rad" if joint.turns else "mm" for joint in machine.joints]
    low, high = _joint_limits(machine)
    found += _named(configuration.passive, low, high, names, units, configuration.converged)
    return sorted(found, key=lambda v: v.pose)


def _joint_limits(machine: Machine) -> tuple[Array, Array]:
    limits = np.array([joint.limits for joint in machine.joints]).reshape(-1, 2)
    return limits[:, 0], limits[:, 1]


def _named(
    values: Array, low: Array, high: Array, names: list[str], units: list[str], closed: BoolArray
) -> list[Violation]:
    return [
        Violation(
            int(pose), names[k], float(values[k, pose]), float(low[k]), float(high[k]), units[k]
        )
        for k, pose in np.argwhere(_excess(values, low, high) & closed)
    ]
