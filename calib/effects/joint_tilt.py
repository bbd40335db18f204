"""The first axis of a universal joint points off its nominal direction.

The joint's frame is turned by small angles about its two local axes that are not its first axis;
about that one nothing changes. The leg is a pure force along u from C to D (docs/papers.md: it
lies in the plane of the joint's first axis and its arm), so at fixed pose the turn e moves C by
e x (C - B), which acts like an extension +u . (e x (C - B)); on the platform it moves D and acts
like -u . (e x (D - P)). Where the axes meet, C = B: a tilt moves nothing at all.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.legs import LegJoint, leg_joints, why_no_joints
from calib.effects.lengthened import Change, lengthened
from calib.effects.limb_frames import frames_along, limb_labels
from calib.mechanism.description import Machine
from calib.mechanism.rigid import cross
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
        return "" if _joints(machine) else why_no_joints(machine, arm=True)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-tilt.leg1.base.y`` ..., rad."""
        labels = limb_labels(rows.machine)
        names = [
            f"joint-tilt.{labels[one.leg.limb]}.{one.body}.{'xyz'[axis]}"
            for one in _joints(rows.machine)
            for axis in _tilting(rows.machine, one)
        ]
        return tuple(Unknown(name, "rad", SIGMA_RAD, sigma=SIGMA_RAD) for name in names)

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each joint alone."""
        return alone(len(_joints(rows.machine)), 2)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Motion of the arm's end along the leg."""
        machine, joints = situation.machine, _joints(situation.machine)
        changes = []
        for number, one in enumerate(joints):
            leg, limb = one.leg, machine.limbs[one.leg.limb]
            frames = frames_along(machine, limb, situation.rows.extension, situation.passive)
            along = frames[leg.head][0] - frames[leg.foot][0]
            along = along / np.sqrt(np.sum(along**2, axis=0))
            place, axes = frames[one.joint.first]
            sign = leg.sense
            if one.body == "platform":
                axes, sign = frames[one.joint.first + 1][1], -sign
            arm = frames[one.joint.second][0] - place
            for k, axis in enumerate(_tilting(machine, one)):
                moved = np.sum(along * cross(axes[:, axis], arm), axis=0)
                changes.append(Change(2 * number + k, leg.limb, leg.length, sign * moved))
        return lengthened(situation, changes, 2 * len(joints))


def _joints(machine: Machine) -> list[LegJoint]:
    """Universal joints of legs that have an arm."""
    return [one for one in leg_joints(machine) if one.square and one.arm]


def _tilting(machine: Machine, one: LegJoint) -> tuple[int, int]:
    """The two local axes of a joint's frame beside its first axis."""
    axis = machine.limbs[one.leg.limb].elements[one.joint.first].axis
    return (axis + 1) % 3, (axis + 2) % 3


EFFECTS = (JointTilt(),)
