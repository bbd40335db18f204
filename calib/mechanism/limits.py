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


@dataclass(frozen=True, eq=False)
class Margin:
    """Kept free at both ends of each range: ``actuators`` (n,), ``joints`` (J,), mm or rad."""

    actuators: Array
    joints: Array

    def widened(self, by: Array) -> "Margin":
        """The same with ``by`` (n,) more at the actuators."""
        return Margin(self.actuators + by, self.joints)


def _excess(values: Array, low: Array, high: Array) -> BoolArray:
    return (values < low[:, None]) | (values > high[:, None]) | ~np.isfinite(values)


def within_limits(
    machine: Machine,
    configuration: Configuration,
    controller: Mapping[str, float] | None = None,
    margin: Margin | None = None,
) -> BoolArray:
    """Whether each configuration closes within strokes and joint limits, shape (N,).

    ``controller`` holds the controller's own parameters, to which the actuators refer; ``margin``
    is kept free at the ends of all ranges.
    """
    q = machine.coordinates(configuration.extension, controller)
    inside: BoolArray = configuration.converged.copy()
    inside &= ~np.any(_excess(q, *_stroke(machine, margin)), axis=0)
    inside &= ~np.any(_excess(configuration.passive, *_joint_limits(machine, margin)), axis=0)
    return inside


def passes_none(machine: Machine, q: Array, configuration: Configuration) -> bool:
    """Whether all of it is within limits, commanded to coordinates q (n, N)."""
    values = np.concatenate([q, configuration.passive])
    low, high = machine.limits
    return bool(((values >= low) & (values <= high)).all())


def violations(
    machine: Machine,
    configuration: Configuration,
    controller: Mapping[str, float] | None = None,
    margin: Margin | None = None,
) -> list[Violation]:
    """Every limit that is passed, pose by pose; a pose that does not close is one violation.

    The limits are those that ``margin`` leaves.
    """
    q = machine.coordinates(configuration.extension, controller)
    if margin is None and configuration.converged.all() and passes_none(machine, q, configuration):
        return []
    found = [
        Violation(int(i), "the pose cannot be reached: the limbs do not close", np.nan, 0, 0, "")
        for i in np.flatnonzero(~configuration.converged)
    ]
    low, high = _stroke(machine, margin)
    passed = _excess(q, low, high) & configuration.converged
    if passed.any():
        names = [a.name for a in machine.actuators]
        found += _named(passed, q, low, high, names, [a.unit for a in machine.actuators])
    low, high = _joint_limits(machine, margin)
    passed = _excess(configuration.passive, low, high) & configuration.converged
    if passed.any():
        names = [f"{limb.name}.{joint.name}" for limb in machine.limbs for joint in limb.joints]
        units = ["rad" if joint.turns else "mm" for joint in machine.joints]
        found += _named(passed, configuration.passive, low, high, names, units)
    return sorted(found, key=lambda v: v.pose)


def kept_at(machine: Machine, configuration: Configuration, margin: Margin) -> Margin:
    """As much of a margin as one configuration (N = 1) itself keeps, and none where it is past."""
    q = machine.coordinates(configuration.extension)
    return Margin(
        _room(margin.actuators, q[:, 0], *_stroke(machine, None)),
        _room(margin.joints, configuration.passive[:, 0], *_joint_limits(machine, None)),
    )


def _room(most: Array, values: Array, low: Array, high: Array) -> Array:
    """Smaller of ``most`` and the distance to the nearer limit, (m,)."""
    return np.clip(np.minimum(values - low, high - values), 0.0, most)


def _stroke(machine: Machine, margin: Margin | None) -> tuple[Array, Array]:
    low, high = machine.q_limits.T
    return (low, high) if margin is None else (low + margin.actuators, high - margin.actuators)


def _joint_limits(machine: Machine, margin: Margin | None) -> tuple[Array, Array]:
    low, high = machine.joint_limits.T
    return (low, high) if margin is None else (low + margin.joints, high - margin.joints)


def _named(
    passed: BoolArray, values: Array, low: Array, high: Array, names: list[str], units: list[str]
) -> list[Violation]:
    return [
        Violation(
            int(pose), names[k], float(values[k, pose]), float(low[k]), float(high[k]), units[k]
        )
        for k, pose in np.argwhere(passed)
    ]
