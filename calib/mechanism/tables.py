"""A machine as two flat tables of numbers, which the compiled core walks (core/tables.c)."""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array, CIntArray
from calib.mechanism.compiled import Compiled, Group, compile_machine
from calib.mechanism.description import Element, Machine
from calib.mechanism.task import FULL

VERSION = 1
INDEPENDENT = 11
"""Where the header says that the inverse goes limb by limb."""
_KINDS = {"parameter": 0, "actuator": 1, "passive": 2}
_TASKS = (*FULL, "tilt", "azimuth")


def fits(machine: Machine) -> bool:
    """Whether the core knows everything that this machine has."""
    groups = compile_machine(machine).groups
    return (
        all(
            group.published_rows is None
            and len(group.passive) <= 6
            and not any(group.elements[k].terms for k in group.compliant)
            for group in groups
        )
        and sum(group.rows * group.count for group in groups) >= 6
    )


def actuator_units(machine: Machine) -> Array:
    """A turn by one rad, or a way as long as the machine, in the unit of each actuator (n,)."""
    return np.array(
        [(machine.size if axis.moves == "mm" else 1.0) / axis.ratio for axis in machine.axes]
    )


def passive_units(machine: Machine) -> Array:
    """What is a step of one of each passive coordinate (J,): 1 rad, or the machine's size."""
    return np.array([1.0 if joint.turns else machine.size for joint in machine.joints])


def flat_tables(machine: Machine) -> tuple[CIntArray, Array]:
    """Integers and reals that describe a machine to the core.

    Integers: a header of twelve, the task's coordinates, then per limb (elements, first passive
    coordinate, passive coordinates, released, rows), per element (turns, axis, quarter turns or
    -1, row of its strain or -1, terms) and per term (kind, index). Reals: size, one over the units
    of actuators and of passive coordinates, per element (constant, compliance), per term a factor.
    """
    compiled = compile_machine(machine)
    strains = _strain_rows(compiled)
    owner = {i: group for group in compiled.groups for i in group.limbs}
    limbs, elements, terms, values, factors = [], [], [], [], []
    for i, limb in enumerate(machine.limbs):
        group = owner[i]
        limbs += [len(limb.elements), limb.first_joint, len(limb.joints)]
        limbs += [limb.released, group.rows]
        for k, element in enumerate(limb.elements):
            row = strains.get((i, k), -1)
            elements += [element.turns, element.axis, _quarters(element), row, len(element.terms)]
            values += [element.constant, element.compliance]
            for term in element.terms:
                terms += [_KINDS[term.kind], term.index]
                factors.append(term.factor)
    header = [
        VERSION, len(machine.limbs), len(elements) // 5, len(factors), len(machine.parameters),
        len(machine.actuators), len(machine.joints), len(strains), len(machine.task.coordinates),
        machine.task.coordinates == FULL, compiled.redundant, _independent(machine, compiled),
    ]  # fmt: skip
    task = [_TASKS.index(name) for name in machine.task.coordinates]
    units = [*(1.0 / actuator_units(machine)), *(1.0 / passive_units(machine))]
    return (
        np.array([*header, *task, *limbs, *elements, *terms], dtype=np.intc),
        np.array([machine.size, *units, *values, *factors], dtype=float),
    )


def _strain_rows(compiled: Compiled) -> dict[tuple[int, int], int]:
    """Row of the strain of (limb, element), as the groups' strains lie one after the other."""
    rows: dict[tuple[int, int], int] = {}
    for group in compiled.groups:
        for k in group.compliant:
            for limb in group.limbs:
                rows[limb, k] = len(rows)
    return rows


def _quarters(element: Element) -> int:
    """How many quarter turns a fixed rotation makes; -1 for anything else."""
    if not element.turns or element.terms or element.compliance > 0.0:
        return -1
    turns = round(element.constant / (np.pi / 2.0))
    return turns % 4 if abs(element.constant - turns * (np.pi / 2.0)) < 1e-15 else -1


def _independent(machine: Machine, compiled: Compiled) -> bool:
    """Whether each limb has actuators of its own that hold the platform against its wrenches."""
    if machine.task.coordinates != FULL or compiled.redundant:
        return False
    groups = [(group, i) for group in compiled.groups for i in group.limbs]
    driven = [set(_actuators(machine, i)) for _, i in groups]
    return sum(map(len, driven)) == len(set().union(*driven)) == len(machine.actuators) and all(
        len(own) == _carried(group) for own, (group, _) in zip(driven, groups, strict=True)
    )


def _carried(group: Group) -> int:
    return group.wrenches if group.rows == group.wrenches else -1


def _actuators(machine: Machine, limb: int) -> Iterator[int]:
    for element in machine.limbs[limb].elements:
        yield from (term.index for term in element.terms if term.kind == "actuator")
