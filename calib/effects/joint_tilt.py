"""The first axis of a universal joint points off its nominal direction.

The joint's frame is turned by small angles about its two local axes that are not its first axis;
about that one nothing changes. The leg is a pure force along u from C to D (docs/papers.md: it
lies in the plane of the joint's first axis and its arm), so at fixed pose the turn e moves C by
e x (C - B), which acts like an extension +u . (e x (C - B)); on the platform it moves D and acts
like -u . (e x (D - P)). Where the axes meet, C = B: a tilt moves nothing at all.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.legs import Leg, arm_between, leg_of
from calib.effects.lengthened import Change, lengthened
from calib.effects.limb_frames import frames_along, limb_labels, turn_about
from calib.mechanism.description import Machine
from calib.mechanism.rigid import cross, product
from calib.mechanism.traits import UniversalJoint
from calib.runs.stack import Rows
from calib.unknown import Unknown

SIGMA_RAD = 1e-3


class JointTilt(Effect):
    """Two angles for each universal joint of each leg."""

    id = "joint-tilt"
    kind = "machine"
    says = "the first axis of a joint points off its nominal direction"

    def lacking(self, machine: Machine) -> str:
        """Legs must stand on universal joints with an arm between their axes."""
        if list(_joints(machine)):
            return ""
        if any(limb.traits.base_joint or limb.traits.platform_joint for limb in machine.limbs):
            return "the axes of its universal joints meet: a tilt of the first moves nothing"
        return "its file names no leg on a universal joint (traits base_joint, platform_joint)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-tilt.leg1.base.y`` ..., rad."""
        machine = rows.machine
        labels = limb_labels(machine)
        return tuple(
            Unknown(
                f"joint-tilt.{labels[leg.limb]}.{body}.{'xyz'[axis]}",
                "rad", SIGMA_RAD, sigma=SIGMA_RAD,
            )
            for leg, body, joint in _joints(machine)
            for axis in _tilting(machine, leg, joint)
        )  # fmt: skip

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each joint alone."""
        return alone(len(list(_joints(rows.machine))), 2)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Motion of the arm's end along the leg."""
        machine = situation.machine
        joints = list(_joints(machine))
        changes = []
        for number, (leg, body, joint) in enumerate(joints):
            limb = machine.limbs[leg.limb]
            frames = frames_along(situation, limb)
            along = frames[leg.head][0] - frames[leg.foot][0]
            along = along / np.sqrt(np.sum(along**2, axis=0))
            place, axes = frames[joint.first]
            sign = 1.0 if body == "base" else -1.0
            if body == "platform":
                axes = _after(situation, leg, joint, axes)
            arm = frames[joint.second][0] - place
            for k, axis in enumerate(_tilting(machine, leg, joint)):
                moved = np.sum(along * cross(axes[:, axis], arm), axis=0)
                changes.append(
                    Change(2 * number + k, leg.limb, leg.length, leg.sense * sign * moved)
                )
        return lengthened(situation, changes, 2 * len(joints))


def _joints(machine: Machine) -> Iterator[tuple[Leg, str, UniversalJoint]]:
    """Legs, and those universal joints at their ends that have an arm."""
    for number, limb in enumerate(machine.limbs):
        leg = leg_of(machine, number)
        for body, joint in (("base", limb.traits.base_joint),
                            ("platform", limb.traits.platform_joint)):  # fmt: skip
            if leg is not None and joint is not None and arm_between(machine, limb, joint):
                yield leg, body, joint


def _tilting(machine: Machine, leg: Leg, joint: UniversalJoint) -> tuple[int, int]:
    """The two local axes of a joint's frame beside its first axis."""
    axis = machine.limbs[leg.limb].elements[joint.first].axis
    return (axis + 1) % 3, (axis + 2) % 3


def _after(situation: Situation, leg: Leg, joint: UniversalJoint, axes: Array) -> Array:
    """Axes (3, 3, N) of the platform joint's frame: those after its own turn."""
    element = situation.machine.limbs[leg.limb].elements[joint.first]
    angle = np.full(situation.rows.count, element.constant)
    for term in element.terms:
        angle = angle + term.factor * situation.passive[term.index]
    return product(axes, turn_about(element.axis, angle))


EFFECTS = (JointTilt(),)
