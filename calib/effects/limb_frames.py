"""Joint frames along a limb, for effects that need to know where its axes point."""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Situation
from calib.mechanism.description import Limb, Machine
from calib.mechanism.rigid import product, rotate


def joint_index(machine: Machine, limb: Limb, name: str) -> int | None:
    """Index of a limb's passive coordinate by its name in the machine file."""
    del machine
    for offset, joint in enumerate(limb.joints):
        if joint.name == name:
            return limb.first_joint + offset
    return None


def frames_along(situation: Situation, limb: Limb) -> dict[str, tuple[Array, Array]]:
    """Origin (3, N) and axes (3, 3, N), base axes, of the frame in which each joint turns.

    The frame is that before the joint's own turn, with nominal parameters. ``"end"`` is the last.
    """
    machine, rows = situation.machine, situation.rows
    names = {limb.first_joint + k: joint.name for k, joint in enumerate(limb.joints)}
    origin = np.zeros((3, rows.count))
    axes = np.repeat(np.eye(3)[:, :, None], rows.count, axis=2)
    found: dict[str, tuple[Array, Array]] = {}
    for element in limb.elements:
        value = np.full(rows.count, element.constant)
        for term in element.terms:
            if term.kind == "parameter":
                value = value + term.factor * machine.nominal[term.index]
            elif term.kind == "actuator":
                value = value + term.factor * rows.extension[term.index]
            else:
                value = value + term.factor * situation.passive[term.index]
                found[names[term.index]] = (origin, axes)
        if element.turns:
            axes = product(axes, _turn(element.axis, value))
        else:
            shift = np.zeros((3, rows.count))
            shift[element.axis] = value
            origin = origin + rotate(axes, shift)
    found["end"] = (origin, axes)
    return found


def _turn(axis: int, angle: Array) -> Array:
    """Rotation (3, 3, N) about a local axis."""
    turn = np.zeros((3, 3, angle.size))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    turn[axis, axis] = 1.0
    turn[one, one] = turn[two, two] = np.cos(angle)
    turn[two, one] = np.sin(angle)
    turn[one, two] = -turn[two, one]
    return turn
