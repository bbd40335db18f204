"""Struts that are screws without a guide: where their joints' first axes point, how they stand."""

from dataclasses import dataclass

import numpy as np

from calib.effects.limb_frames import frames_along
from calib.mechanism.description import Machine
from calib.mechanism.solve import home_configuration


@dataclass(frozen=True)
class Strut:
    """One strut of the drawing at home.

    ``base_normal`` (base frame) and ``platform_normal`` (platform frame) are unit vectors of its
    joints' first axes; ``home_turn``, rad, is the turn about the strut, right-handed from base to
    platform, from the second axis of the base joint to that of the platform joint.
    """

    limb: str
    base_normal: tuple[float, float, float]
    platform_normal: tuple[float, float, float]
    home_turn: float


def struts_of(machine: Machine) -> tuple[Strut, ...]:
    """Every limb as a strut, in their order; empty if one of them is none."""
    traits = [limb.traits for limb in machine.limbs]
    if any(t.screw is None or not t.base_joint or not t.platform_joint for t in traits):
        return ()
    home = home_configuration(machine)
    found = []
    for limb in machine.limbs:
        base, platform, screw = (
            limb.traits.base_joint,
            limb.traits.platform_joint,
            limb.traits.screw,
        )
        assert base is not None
        assert platform is not None
        assert screw is not None
        frames = frames_along(machine, limb, home.extension, home.passive)
        # The last frame of a limb is the platform's.
        lower, upper, last = (frames[k][1][:, :, 0] for k in (base.first, platform.first, -1))
        turn = next(t for t in limb.elements[screw].terms if t.kind == "passive")
        drive = next(t for e in limb.elements for t in e.terms if t.kind == "actuator")
        turned = turn.factor / drive.factor * float(home.passive[turn.index, 0])
        found.append(
            Strut(
                limb.name,
                _vector(lower[:, limb.elements[base.first].axis]),
                _vector(last.T @ upper[:, limb.elements[platform.first].axis]),
                float(np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi),
            )
        )
    return tuple(found)


def _vector(direction: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(c) for c in direction)
    return x, y, z
