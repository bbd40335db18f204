"""Parallel machines to URDF: a tree, and the loops that close it (files/urdf_loops.py)."""

from collections.abc import Mapping

import numpy as np

from app.files.urdf import UrdfArm, UrdfJoint, angles_of, transform, urdf_text
from app.files.urdf_loops import Loop, Loops, written_loops
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Element, Machine
from calib.mechanism.rigid import from_euler
from calib.mechanism.solve import home_configuration


def closed_urdf(
    machine: Machine, values: Mapping[str, float], controller: Mapping[str, float], remark: str
) -> str:
    """A URDF of a parallel machine with the geometry that was found, and its loops.

    The first limb carries the platform; every other one ends in a link that is welded to it.

    Raises
    ------
    BadInput
        For a machine whose limbs close only because parts yield.
    """
    if compile_machine(machine).redundant:
        raise BadInput(
            f'the limbs of "{machine.name}" close only because parts of them yield: no URDF',
            place="--as urdf",
            remedy="Export parameters in another form",
        )
    parameters, reference = machine.vector(values), machine.reference(controller)
    passive = home_configuration(machine).passive[:, 0]
    joints: list[UrdfJoint] = []
    home: dict[str, float] = {}
    leaders: dict[tuple[str, int], tuple[str, float]] = {}
    ends: list[str] = []
    for number, limb in enumerate(machine.limbs, start=1):
        link, frame = "base", np.eye(4)
        for element in limb.elements:
            fixed, moved = _value(element, parameters, reference)
            frame = frame @ _step(element, fixed)
            if moved is None:
                continue
            joint, start = _placed(machine, element, moved, leaders, passive, frame, link)
            if joint.mimic is None:
                home[joint.name] = start
            joints.append(joint)
            link, frame = joint.child, np.eye(4)
        end = "platform" if number == 1 else f"end{number}"
        joints.append(UrdfJoint(f"{end}_joint", "fixed", link, end, frame[:3, 3],
                                angles_of(frame[:3, :3])))  # fmt: skip
        ends.append(end)
    loops = tuple(Loop(end, ends[0], np.eye(4), np.eye(4), "fixed") for end in ends[1:])
    driven = tuple(name for (kind, _), (name, _) in leaders.items() if kind == "actuator")
    order = sorted(driven, key=[a.name for a in machine.actuators].index)
    arm = UrdfArm(machine.name, tuple(joints))
    found = Loops(ends[0], tuple(order), machine.task.coordinates, home, loops)
    return urdf_text(arm, remark, written_loops(found))


def _value(
    element: Element, parameters: Array, reference: Array
) -> tuple[float, tuple[str, int, float] | None]:
    """Fixed part of an element, and what moves it: kind, index, factor."""
    fixed, moved = element.constant, None
    for term in element.terms:
        if term.kind == "parameter":
            fixed += term.factor * float(parameters[term.index])
        else:
            moved = (str(term.kind), term.index, term.factor)
            if term.kind == "actuator":
                fixed -= term.factor * float(reference[term.index])
    return fixed, moved


def _step(element: Element, value: float) -> Array:
    along = np.zeros(3)
    along[element.axis] = value
    if element.turns:
        made = np.eye(4)
        made[:3, :3] = from_euler(*along)
        return made
    return transform(along * 1e-3, np.zeros(3))


def _placed(
    machine: Machine,
    element: Element,
    moved: tuple[str, int, float],
    leaders: dict[tuple[str, int], tuple[str, float]],
    passive: Array,
    frame: Array,
    parent: str,
) -> tuple[UrdfJoint, float]:
    """A moving joint, and its value at home, rad or m."""
    kind, index, factor = moved
    actuator = machine.actuators[index] if kind == "actuator" else None
    if actuator is not None and (
        (actuator.unit == "rad") != element.turns
        or (abs(factor) != 1.0 and (kind, index) not in leaders)
    ):
        raise BadInput(
            f"actuator {actuator.name} moves its joint through a gear or a screw; a joint of a "
            "URDF is moved by its own coordinate",
            place="--as urdf",
            remedy="Describe the machine by the joint's coordinate",
        )
    scale = 1.0 if element.turns else 1e-3
    axis, mimic = np.zeros(3), None
    own = actuator.name if actuator is not None else f"passive{index + 1}"
    value = actuator.home if actuator is not None else float(passive[index])
    if (kind, index) in leaders:
        leader, first = leaders[kind, index]
        own = f"{leader}_{parent}"
        axis[element.axis] = np.sign(first)
        mimic = (leader, float(factor / first), 0.0)
    else:
        leaders[kind, index] = (own, factor)
        axis[element.axis] = np.sign(factor)
    if actuator is not None:
        limits = tuple(sorted(scale * float(v) for v in actuator.limits))
    else:
        reach = np.pi if element.turns else 10.0
        limits = (-float(reach), float(reach))
    low, high = limits
    joint = UrdfJoint(
        own, "revolute" if element.turns else "prismatic", parent, f"link_{own}",
        frame[:3, 3], angles_of(frame[:3, :3]), axis, (low, high), mimic,
    )  # fmt: skip
    return joint, scale * value
