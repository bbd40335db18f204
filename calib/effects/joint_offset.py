"""The two axes of a universal joint do not meet: for machine files that let them meet.

A leg of length l stands between C = B + L_B n_B and D = P + L_P n_P (docs/papers.md), while
the file puts it between B and P. At the same pose the file's leg is longer by |P - B| - |D - C|,
which with a = D - C, b = L_B n_B - L_P n_P equals b . (2 a + b) / (|a + b| + |a|): exact, and
linear in L_B and L_P once the directions are known. n_B is the direction of D - B in the plane
across the joint's first axis, n_P that of C - P.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown, alone
from calib.effects.limb_frames import frames_along, joint_index
from calib.mechanism.description import Machine
from calib.mechanism.rigid import rotate
from calib.runs.stack import Rows

PASSES = 4


class JointOffset(Effect):
    """An arm at the base and one at the platform for each leg."""

    id = "joint-offset"
    kind = "machine"
    says = "the two axes of a universal joint do not meet"

    def applies(self, machine: Machine) -> bool:
        """Where legs stand between universal joints and the file has no L_B, L_P."""
        names = {parameter.name for parameter in machine.parameters}
        return len(machine.limbs) == len(machine.actuators) and all(
            joint_index(machine, limb, "psi_B") is not None
            and joint_index(machine, limb, "psi_P") is not None
            and f"{limb.name}.L_B" not in names
            for limb in machine.limbs
        )

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-offset.leg1.L_B``, ``.L_P`` ..., mm."""
        return tuple(
            Unknown(f"joint-offset.{limb.name}.{arm}", "mm", 5.0)
            for limb in rows.machine.limbs
            for arm in ("L_B", "L_P")
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each leg alone."""
        return alone(len(rows.machine.actuators), 2)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Difference of the legs' lengths, per arm."""
        shape = np.zeros((2 * len(situation.machine.limbs), *situation.rows.extension.shape))
        for leg, limb in enumerate(situation.machine.limbs):
            frames = frames_along(situation, limb)
            B, across_B = frames["psi_B"][0], frames["psi_B"][1][:, 0]
            across_P = frames["psi_P"][1][:, 0]
            P = situation.position + rotate(situation.rotation, _platform_joint(situation, leg))
            L_B, L_P = values[2 * leg], values[2 * leg + 1]
            C, D = B, P
            for _ in range(PASSES):
                n_B, n_P = _direction(D - B, across_B), _direction(C - P, across_P)
                C, D = B + L_B * n_B, P + L_P * n_P
            whole, leg_vector = P - B, D - C
            middle = (whole + leg_vector) / (_norm(whole) + _norm(leg_vector))
            shape[2 * leg, leg] = np.sum(n_B * middle, axis=0)
            shape[2 * leg + 1, leg] = -np.sum(n_P * middle, axis=0)
        return Signature(extension=shape)


def _platform_joint(situation: Situation, leg: int) -> Array:
    """Nominal centre (3, 1) of a leg's platform joint, platform frame."""
    machine = situation.machine
    name = machine.limbs[leg].name
    return machine.nominal[[machine.index(f"{name}.P_{axis}") for axis in "xyz"]][:, None]


def _direction(vector: Array, across: Array) -> Array:
    """Unit vector of what is left of ``vector`` (3, N) perpendicular to ``across``."""
    left = vector - np.sum(vector * across, axis=0) * across
    return np.asarray(left / _norm(left))


def _norm(vector: Array) -> Array:
    return np.asarray(np.sqrt(np.sum(vector * vector, axis=0)))


EFFECTS = (JointOffset(),)
