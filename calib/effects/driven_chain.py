"""Joints of an arm: chains in which every joint is driven, and which of them turn."""

from dataclasses import dataclass

from calib.mechanism.description import Machine


@dataclass(frozen=True)
class DrivenJoint:
    """A joint that turns by one actuator: indices of actuator, chain and element, joint per q."""

    actuator: int
    limb: int
    element: int
    factor: float


def driven_joints(machine: Machine) -> list[DrivenJoint]:
    """Turning joints of all arms of a machine, from base to tip; none of a parallel machine.

    An actuator that moves several joints counts where it does so first.
    """
    found: list[DrivenJoint] = []
    for number, limb in enumerate(machine.limbs):
        own = [
            DrivenJoint(term.index, number, k, term.factor)
            for k, element in enumerate(limb.elements)
            for term in element.terms
            if term.kind == "actuator" and element.turns
        ]
        first = {joint.actuator: joint for joint in reversed(own)}
        if not limb.joints and len(first) > 1:
            found += [joint for joint in own if first[joint.actuator] is joint]
    return found


def no_arm(machine: Machine) -> str:
    """Say why a machine has no such joints; empty where it has."""
    if driven_joints(machine):
        return ""
    return "it is no arm: no chain in which all joints are driven, two of them turning"
