"""The first axis of a universal joint points off its nominal direction.

The joint's frame is turned by small angles about its local y and z; about x nothing changes. The
leg is a pure force along u from C to D (docs/papers.md: it lies in the plane of the joint's
first axis and its arm), so at fixed pose the turn e moves C by e x (C - B), which acts
like an extension +u . (e x (C - B)); on the platform it moves D and acts like -u . (e x (D - P)).
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown, alone
from calib.effects.limb_frames import frames_along, joint_index
from calib.mechanism.description import Limb, Machine
from calib.mechanism.rigid import cross
from calib.runs.stack import Rows

SIGMA_RAD = 1e-3
JOINTS = ("psi_B", "swing_B", "swing_P", "psi_P")


class JointTilt(Effect):
    """Two angles for each joint of each leg."""

    id = "joint-tilt"
    kind = "machine"
    says = "the first axis of a joint points off its nominal direction"

    def applies(self, machine: Machine) -> bool:
        """Where legs stand between two universal joints whose axes do not meet."""
        return len(machine.limbs) == len(machine.actuators) and all(
            joint_index(machine, limb, name) is not None
            for limb in machine.limbs
            for name in JOINTS
        )

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-tilt.leg1.base.y`` ..., rad."""
        return tuple(
            Unknown(f"joint-tilt.{limb.name}.{body}.{axis}", "rad", SIGMA_RAD, sigma=SIGMA_RAD)
            for limb in rows.machine.limbs
            for body in ("base", "platform")
            for axis in "yz"
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each joint alone."""
        return alone(2 * len(rows.machine.actuators), 2)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Motion of the arm's end along the leg."""
        machine = situation.machine
        shape = np.zeros((4 * len(machine.actuators), *situation.rows.extension.shape))
        for leg, limb in enumerate(machine.limbs):
            frames = frames_along(situation, limb)
            base, start = frames["psi_B"], frames["swing_B"][0]
            end, joint = frames["swing_P"][0], frames["psi_P"]
            along = end - start
            along = along / np.sqrt(np.sum(along**2, axis=0))
            after = _after(situation.passive[_index(machine, limb, "psi_P")], joint[1])
            for k, axis in enumerate((1, 2)):
                turned = cross(base[1][:, axis], start - base[0])
                shape[4 * leg + k, leg] = np.sum(along * turned, axis=0)
                turned = cross(after[:, axis], end - joint[0])
                shape[4 * leg + 2 + k, leg] = -np.sum(along * turned, axis=0)
        return Signature(extension=shape)


def _index(machine: Machine, limb: Limb, name: str) -> int:
    index = joint_index(machine, limb, name)
    assert index is not None, "applies() has checked it"
    return index


def _after(angle: Array, axes: Array) -> Array:
    """Axes (3, 3, N) of the platform joint's frame: those after its turn psi_P about x."""
    cosine, sine = np.cos(angle), np.sin(angle)
    y, z = axes[:, 1], axes[:, 2]
    return np.stack([axes[:, 0], cosine * y + sine * z, cosine * z - sine * y], axis=1)


EFFECTS = (JointTilt(),)
