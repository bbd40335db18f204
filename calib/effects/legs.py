"""Legs between two joints: which element of the chain is the leg, and where its ends are."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calib.effects.limb_frames import frames_along, nominal_value
from calib.mechanism.description import Limb, Machine
from calib.mechanism.solve import home_configuration
from calib.mechanism.traits import UniversalJoint

SQUARE = 1e-6
"""Cosine (of the arm: mm) up to which two directions stand square on each other."""


@dataclass(frozen=True)
class Leg:
    """A limb that is a leg: elements of its chain.

    ``length`` is the translation that is the leg, ``sense`` the sign of its value; ``foot`` and
    ``head`` are the last joint axis before it and the first behind it.
    """

    limb: int
    length: int
    sense: float
    foot: int
    head: int


@dataclass(frozen=True)
class LegJoint:
    """A universal joint at the ``base`` or at the ``platform`` end of a leg.

    ``square``: at home the second axis stands square on the first, on the arm and on the leg, so
    that leg and first axis lie in one plane; ``arm``: the file puts the axes apart.
    """

    leg: Leg
    body: str
    joint: UniversalJoint
    arm: bool
    square: bool


@lru_cache(maxsize=64)
def leg_joints(machine: Machine) -> tuple[LegJoint, ...]:
    """Every universal joint of every leg, base before platform; cached by the machine."""
    found = []
    for number, limb in enumerate(machine.limbs):
        leg = leg_of(machine, number)
        for body, joint in (
            ("base", limb.traits.base_joint),
            ("platform", limb.traits.platform_joint),
        ):
            if leg is not None and joint is not None:
                arm = bool(arm_between(machine, limb, joint))
                found.append(LegJoint(leg, body, joint, arm, _square(machine, leg, joint)))
    return tuple(found)


def why_no_joints(machine: Machine, *, arm: bool) -> str:
    """Why no universal joint of a leg is of this kind, for :meth:`Effect.lacking`."""
    joints = leg_joints(machine)
    if not joints:
        return "its file names no leg on a universal joint (traits base_joint, platform_joint)"
    if any(one.arm == arm for one in joints):
        return "its legs do not stand square on the axes of their universal joints"
    if arm:
        return "the axes of its universal joints meet: a tilt of the first moves nothing"
    return "its file knows how far the axes of its universal joints are apart"


def _square(machine: Machine, leg: Leg, joint: UniversalJoint) -> bool:
    limb, home = machine.limbs[leg.limb], home_configuration(machine)
    frames = frames_along(machine, limb, home.extension, home.passive)
    first, second = (frames[k][1][:, limb.elements[k].axis, 0] for k in (joint.first, joint.second))
    along = frames[leg.head][0][:, 0] - frames[leg.foot][0][:, 0]
    arm = frames[joint.second][0][:, 0] - frames[joint.first][0][:, 0]
    parts = [abs(second @ first), abs(second @ along) / np.linalg.norm(along), abs(second @ arm)]
    return bool(max(parts) < SQUARE)


def leg_of(machine: Machine, number: int) -> Leg | None:
    """The leg of a limb with a universal joint; None where no single translation is one."""
    limb = machine.limbs[number]
    base, platform = limb.traits.base_joint, limb.traits.platform_joint
    if base is None and platform is None:
        return None
    first = base.second + 1 if base else 0
    last = platform.second if platform else len(limb.elements)
    lengths = {
        k: nominal_value(machine, limb, k)
        for k in range(first, last)
        if _is_length(limb, k) and _after_a_joint(limb, k) and _before_a_joint(limb, k)
    }
    driven = [k for k in lengths if any(t.kind == "actuator" for t in limb.elements[k].terms)]
    chosen = driven or [k for k, value in lengths.items() if value]
    if len(chosen) != 1:
        return None
    length = chosen[0]
    foot = base.second if base else max(k for k in range(length) if _turns_freely(limb, k))
    head = (
        platform.second
        if platform
        else min(k for k in range(length, len(limb.elements)) if _turns_freely(limb, k))
    )
    return Leg(number, length, -1.0 if lengths[length] < 0.0 else 1.0, foot, head)


def arm_between(machine: Machine, limb: Limb, joint: UniversalJoint) -> list[int]:
    """Translations between the two axes of a universal joint that the file knows of.

    Fixed ones that are not zero, and those that are calibrated; none where the axes meet.
    """
    low, high = sorted((joint.first, joint.second))
    return [
        k
        for k in range(low + 1, high)
        if not limb.elements[k].turns
        and not limb.elements[k].compliance
        and (nominal_value(machine, limb, k) or limb.elements[k].terms)
    ]


def _is_length(limb: Limb, index: int) -> bool:
    element = limb.elements[index]
    slides = any(term.kind == "passive" for term in element.terms)
    return not element.turns and not element.compliance and not slides


def _turns_freely(limb: Limb, index: int) -> bool:
    element = limb.elements[index]
    return element.turns and any(term.kind == "passive" for term in element.terms)


def _after_a_joint(limb: Limb, index: int) -> bool:
    return any(_turns_freely(limb, k) for k in range(index))


def _before_a_joint(limb: Limb, index: int) -> bool:
    return any(_turns_freely(limb, k) for k in range(index, len(limb.elements)))
