"""The two axes of a universal joint do not meet: for machine files that let them meet.

A leg of length l stands between C = B + L_B n_B and D = P + L_P n_P, while the file puts it
between B and P. At the same pose the file's leg is longer by |P - B| - |D - C|, which with
a = D - C, b = L_B n_B - L_P n_P equals b . (2 a + b) / (|a + b| + |a|): exact, and linear in L_B
and L_P once the directions are known. n_B is the direction of D - B in the plane across the
joint's first axis, n_P that of C - P (Han et al. 2020; docs/papers.md).
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.effects.legs import Leg, LegJoint, leg_joints, why_no_joints
from calib.effects.lengthened import Change, lengthened
from calib.effects.limb_frames import frames_along, limb_labels, place_on_platform
from calib.mechanism.description import Machine
from calib.mechanism.rigid import rotate
from calib.runs.stack import Rows
from calib.unknown import Unknown

PASSES = 4
ARMS = {"base": "L_B", "platform": "L_P"}


class JointOffset(Effect):
    """An arm for each universal joint of each leg."""

    id = "joint-offset"
    kind = "machine"
    says = "the two axes of a universal joint do not meet"

    def lacking(self, machine: Machine) -> str:
        """Legs must stand on universal joints whose axes meet in the file."""
        return "" if _joints(machine) else why_no_joints(machine, arm=False)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-offset.leg1.L_B``, ``.L_P`` ..., mm."""
        labels = limb_labels(rows.machine)
        return tuple(
            Unknown(f"joint-offset.{labels[one.leg.limb]}.{ARMS[one.body]}", "mm", 5.0)
            for one in _joints(rows.machine)
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each leg alone."""
        limbs = [one.leg.limb for one in _joints(rows.machine)]
        return tuple(
            tuple(k for k, own in enumerate(limbs) if own == limb) for limb in dict.fromkeys(limbs)
        )

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Difference of the legs' lengths, per arm."""
        joints = _joints(situation.machine)
        changes = []
        for leg in dict.fromkeys(one.leg for one in joints):
            own = {one.body: k for k, one in enumerate(joints) if one.leg == leg}
            shapes = _shapes(situation, leg, {body: float(values[k]) for body, k in own.items()})
            for body, k in own.items():
                changes.append(Change(k, leg.limb, leg.length, leg.sense * shapes[body]))
        return lengthened(situation, changes, len(joints), closed_anew=True)


def _joints(machine: Machine) -> list[LegJoint]:
    """Universal joints of legs whose axes meet."""
    return [one for one in leg_joints(machine) if one.square and not one.arm]


def _shapes(situation: Situation, leg: Leg, arms: dict[str, float]) -> dict[str, Array]:
    """How much longer (N,) the file's leg is per mm of each arm, for arms of these lengths."""
    limb = situation.machine.limbs[leg.limb]
    frames = frames_along(situation.machine, limb, situation.rows.extension, situation.passive)
    traits = limb.traits
    base, platform = traits.base_joint, traits.platform_joint
    B = frames[leg.foot if base is None else base.first][0]
    joint = leg.head if platform is None else platform.first
    on_platform = place_on_platform(situation.machine, limb, joint)
    P = situation.position + rotate(situation.rotation, on_platform)
    across = {
        body: frames[own.first][1][:, limb.elements[own.first].axis]
        for body, own in (("base", base), ("platform", platform))
        if own is not None and body in arms
    }
    nothing = np.zeros_like(B)
    n_B = n_P = nothing
    C, D = B, P
    for _ in range(PASSES):
        n_B = _direction(D - B, across["base"]) if "base" in arms else nothing
        n_P = _direction(C - P, across["platform"]) if "platform" in arms else nothing
        C, D = B + arms.get("base", 0.0) * n_B, P + arms.get("platform", 0.0) * n_P
    whole, leg_vector = P - B, D - C
    middle = (whole + leg_vector) / (_norm(whole) + _norm(leg_vector))
    return {"base": np.sum(n_B * middle, axis=0), "platform": -np.sum(n_P * middle, axis=0)}


def _direction(vector: Array, across: Array) -> Array:
    """Unit vector of what is left of ``vector`` (3, N) perpendicular to ``across``."""
    left = vector - np.sum(vector * across, axis=0) * across
    return np.asarray(left / _norm(left))


def _norm(vector: Array) -> Array:
    return np.asarray(np.sqrt(np.sum(vector * vector, axis=0)))


EFFECTS = (JointOffset(),)
