"""A joint of an arm follows one before it: extension_i = k_ij s_j.

Belts, shafts through a hollow wrist and parallel drives carry the turn of an inner joint over to
an outer one; controllers take that off again, by a ratio that may be off.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.driven_chain import driven_joints, no_arm
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.unknown import Unknown

AHEAD = 2
"""A joint follows the one before it, or that before this one."""


class JointCoupling(Effect):
    """A ratio for each pair of neighbours."""

    id = "joint-coupling"
    kind = "machine"
    says = "a joint turns a little when one before it does: belt, wrist or drive rod not taken off"

    def lacking(self, machine: Machine) -> str:
        """Joints one behind the other."""
        return no_arm(machine)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-coupling.q3.q2``: how much q3 follows q2, a ratio."""
        axes = rows.machine.axes
        return tuple(
            Unknown(f"joint-coupling.{axes[i].name}.{axes[j].name}", "1", 1e-3)
            for i, j in _pairs(rows.machine)
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each pair alone."""
        return alone(len(_pairs(rows.machine)))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """What the other joint has turned."""
        s, pairs = situation.rows.extension, _pairs(situation.machine)
        shape = np.zeros((len(pairs), *s.shape))
        for number, (follows, leads) in enumerate(pairs):
            shape[number, follows] = s[leads]
        return Signature(extension=shape)


def _pairs(machine: Machine) -> list[tuple[int, int]]:
    """Actuators (i, j) where i may follow j."""
    joints = driven_joints(machine)
    return [
        (one.actuator, other.actuator)
        for k, one in enumerate(joints)
        for other in joints[max(0, k - AHEAD) : k]
        if one.limb == other.limb
    ]


EFFECTS = (JointCoupling(),)
