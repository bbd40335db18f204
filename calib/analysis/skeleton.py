"""Where the limbs of a machine are: joints with their axes, and the lines between them."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.mechanism.description import Element, Limb, Machine
from calib.mechanism.solve import Configuration


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of one limb at one pose: place (3,) and axis (3,) in the base frame, mm."""

    place: Array
    axis: Array
    turns: bool
    driven: bool
    name: str


@dataclass(frozen=True, eq=False)
class LimbLine:
    """One limb: corners (3, k) of the chain from the base to the platform, and its joints.

    ``first`` and ``last`` are the corners at which its first and last joint stand.
    """

    name: str
    corners: Array
    joints: tuple[Joint, ...]
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A machine at one pose: its limbs, and the platform's position (3,) and rotation (3, 3)."""

    limbs: tuple[LimbLine, ...]
    position: Array
    rotation: Array

    @property
    def base_points(self) -> Array:
        """First joint of every limb, (3, L)."""
        return np.stack([limb.corners[:, limb.first] for limb in self.limbs], axis=1)

    @property
    def platform_points(self) -> Array:
        """Last joint of every limb, (3, L)."""
        return np.stack([limb.corners[:, limb.last] for limb in self.limbs], axis=1)


def skeleton(machine: Machine, configuration: Configuration, pose: int = 0) -> Skeleton:
    """Walk along the limbs of the nominal machine at one of the configuration's poses."""
    return Skeleton(
        tuple(_walk(machine, limb, configuration, pose) for limb in machine.limbs),
        configuration.poses.position[:, pose],
        configuration.poses.rotation[:, :, pose],
    )


def _walk(machine: Machine, limb: Limb, configuration: Configuration, pose: int) -> LimbLine:
    frame, place = np.eye(3), np.zeros(3)
    corners, joints, at = [place], [], []
    for element in limb.elements:
        moving = [term for term in element.terms if term.kind != "parameter"]
        if moving:
            driven = moving[0].kind == "actuator"
            own = moving[0].index
            name = (
                machine.actuators[own].name if driven else limb.joints[own - limb.first_joint].name
            )
            joints.append(Joint(place, frame[:, element.axis], element.turns, driven, name))
            at.append(len(corners) - 1)
        value = _value(machine, element, configuration, pose)
        if element.turns:
            frame = frame @ _turn(element.axis, value)
        elif value != 0.0:
            place = place + frame[:, element.axis] * value
            corners.append(place)
    return LimbLine(limb.name, np.array(corners).T, tuple(joints), min(at), max(at))


def _value(machine: Machine, element: Element, configuration: Configuration, pose: int) -> float:
    source = {
        "parameter": machine.nominal,
        "actuator": configuration.extension[:, pose],
        "passive": configuration.passive[:, pose],
    }
    return element.constant + sum(t.factor * float(source[t.kind][t.index]) for t in element.terms)


def _turn(axis: int, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    k, l = (axis + 1) % 3, (axis + 2) % 3  # noqa: E741 - k, l follow the axis cyclically
    R = np.eye(3)
    R[k, k], R[k, l], R[l, k], R[l, l] = c, -s, s, c
    return R
