"""An unguided screw turns about its own axis as the joints swing, and so changes length.

extension_i = L / (2 pi) (twist_i - twist_i at home). The twist is the passive coordinate of that
name in the machine file: the turn about the leg (base to platform, right-handed) from the
base-side second axis to the platform-side one.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown
from calib.effects.limb_frames import joint_index
from calib.mechanism.description import Machine
from calib.runs.stack import Rows


class ScrewTwist(Effect):
    """One lead for all screws."""

    id = "screw-twist"
    kind = "machine"
    says = "an unguided screw turns about its own axis as the joints swing, and changes length"

    def applies(self, machine: Machine) -> bool:
        """Where every limb has an actuator of its own and a passive joint called twist."""
        return len(machine.limbs) == len(machine.actuators) and all(
            joint_index(machine, limb, "twist") is not None for limb in machine.limbs
        )

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``screw-twist.L``, mm per turn."""
        return (Unknown("screw-twist.L", "mm", 2.0),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Turns from home."""
        joints = [joint_index(situation.machine, limb, "twist") for limb in situation.machine.limbs]
        index = np.array(joints, dtype=np.intp)
        turned = situation.passive[index] - situation.passive_home[index][:, None]
        shape = np.zeros((1, *turned.shape))
        for limb, actuator in enumerate(_actuators(situation.machine)):
            shape[0, actuator] = turned[limb] / (2.0 * np.pi)
        return Signature(extension=shape)


def _actuators(machine: Machine) -> list[int]:
    """Index of the actuator in each limb."""
    return [
        next(t.index for e in limb.elements for t in e.terms if t.kind == "actuator")
        for limb in machine.limbs
    ]


EFFECTS = (ScrewTwist(),)
