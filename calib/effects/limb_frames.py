"""Joint frames along a limb, for effects that need to know where its axes point."""

from collections import Counter

import numpy as np

from calib.arrays import Array
from calib.mechanism.description import Limb, Machine
from calib.mechanism.rigid import product, rotate

Placed = tuple[Array, Array]
"""Origin (3, N) and axes (3, 3, N) of a frame."""


def limb_labels(machine: Machine) -> list[str]:
    """A name for each chain: its limb's, numbered where a limb consists of several."""
    count, seen = Counter(limb.name for limb in machine.limbs), Counter[str]()
    labels = []
    for limb in machine.limbs:
        seen[limb.name] += 1
        several = count[limb.name] > 1
        labels.append(f"{limb.name}.{seen[limb.name]}" if several else limb.name)
    return labels


def nominal_value(machine: Machine, limb: Limb, element: int) -> float:
    """Value of an element in the drawing, actuators and joints at zero, mm or rad."""
    chosen = limb.elements[element]
    return chosen.constant + sum(
        term.factor * float(machine.nominal[term.index])
        for term in chosen.terms
        if term.kind == "parameter"
    )


def frames_along(machine: Machine, limb: Limb, extension: Array, passive: Array) -> list[Placed]:
    """Frame before each element of a limb, and the last; base axes, nominal parameters.

    That of a joint is the frame in which it turns: before its own turn. ``extension`` (n, N),
    ``passive`` (n_joints, N).
    """
    count = extension.shape[1]
    origin = np.zeros((3, count))
    axes = np.repeat(np.eye(3)[:, :, None], count, axis=2)
    found = [(origin, axes)]
    for index, element in enumerate(limb.elements):
        value = np.full(count, nominal_value(machine, limb, index))
        for term in element.terms:
            if term.kind == "actuator":
                value = value + term.factor * extension[term.index]
            elif term.kind == "passive":
                value = value + term.factor * passive[term.index]
        if element.turns:
            axes = product(axes, turn_about(element.axis, value))
        else:
            shift = np.zeros((3, count))
            shift[element.axis] = value
            origin = origin + rotate(axes, shift)
        found.append((origin, axes))
    return found


def place_on_platform(machine: Machine, limb: Limb, element: int) -> Array:
    """Nominal place (3, 1) of an element's origin in the platform frame.

    Joints between it and the platform are taken to turn about that place.
    """
    place = np.zeros((3, 1))
    for index in range(element, len(limb.elements)):
        chosen, value = limb.elements[index], nominal_value(machine, limb, index)
        if chosen.turns:
            place = rotate(turn_about(chosen.axis, np.array([-value])), place)
        else:
            place[chosen.axis] -= value
    return place


def turn_about(axis: int, angle: Array) -> Array:
    """Rotation (3, 3, N) about a local axis by angles (N,)."""
    turn = np.zeros((3, 3, angle.size))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    turn[axis, axis] = 1.0
    turn[one, one] = turn[two, two] = np.cos(angle)
    turn[two, one] = np.sin(angle)
    turn[one, two] = -turn[two, one]
    return turn
