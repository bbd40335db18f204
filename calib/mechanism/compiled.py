"""A machine made ready for array work: limbs of equal structure form one array axis."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from calib.arrays import Array, IntArray, Numbers
from calib.mechanism.description import Element, Kind, Limb, Machine, PublishedRow


@dataclass(frozen=True, eq=False)
class ArrayTerm:
    """One term of an element in every limb of a group: variables (L,) and factors (L, 1)."""

    kind: Kind
    index: IntArray
    factor: Array | None
    """None where all factors are one."""


@dataclass(frozen=True, eq=False)
class ArrayElement:
    """One element in every limb of a group; ``constant`` and ``compliance`` are (L, 1)."""

    turns: bool
    axis: int
    constant: Array | None
    terms: tuple[ArrayTerm, ...]
    compliance: Array | None

    @cached_property
    def quarters(self) -> int | None:
        """How many quarter turns a fixed rotation makes, in all limbs alike; None for others."""
        if not self.turns or self.terms or self.constant is None:
            return None
        turns = np.round(self.constant / (np.pi / 2.0))
        exact = np.all(np.abs(self.constant - turns * (np.pi / 2.0)) < 1e-15)
        alike = np.all(turns % 4 == turns.flat[0] % 4)
        return int(turns.flat[0]) % 4 if exact and alike else None


@dataclass(frozen=True, eq=False)
class Group:
    """Limbs of equal structure.

    ``passive`` (n_passive, L) are the machine-wide indices of the passive coordinates; a column
    maps (element, factor) pairs to one variable.
    """

    limbs: tuple[int, ...]
    elements: tuple[ArrayElement, ...]
    passive: IntArray
    passive_columns: tuple[tuple[tuple[int, Array | None], ...], ...]
    compliant: tuple[int, ...]
    unit: Array
    """What counts as a step of one: 1 rad, or the machine's size in mm; (n_passive, L, 1)."""
    released: bool
    published_rows: tuple[PublishedRow, ...] | None

    @property
    def wrenches(self) -> int:
        """Wrenches that each limb can carry: 6 less its passive coordinates."""
        return 6 - len(self.passive)

    @cached_property
    def driven(self) -> tuple[int, ...]:
        """Elements that an actuator moves."""
        return tuple(
            k for k, e in enumerate(self.elements) if any(t.kind == "actuator" for t in e.terms)
        )

    @property
    def rows(self) -> int:
        """Rows of the closure of each limb: its wrenches, less the constraint that it drops."""
        if self.released:
            return min(len(self.driven), self.wrenches)
        return self.wrenches

    @cached_property
    def compliances(self) -> Array:
        """Compliances (n_compliant, L, 1) of the yielding elements."""
        held = [self.elements[k].compliance for k in self.compliant]
        return np.array([c for c in held if c is not None]).reshape(-1, self.count, 1)

    @property
    def count(self) -> int:
        """Number of limbs L."""
        return len(self.limbs)


@dataclass(frozen=True, eq=False)
class Compiled:
    """All groups, and how many wrenches they carry together."""

    groups: tuple[Group, ...]
    wrenches: int
    joint_count: int
    joint_start: Array

    @property
    def redundant(self) -> bool:
        """Whether the limbs are over-constrained (more wrenches than the pose has freedoms)."""
        return self.wrenches > 6


def _signature(limb: Limb) -> object:
    return (
        len(limb.joints),
        limb.released,
        limb.published_rows,
        tuple(
            (e.turns, e.axis, e.compliance > 0.0, tuple(t.kind for t in e.terms))
            for e in limb.elements
        ),
    )


def _element(column: tuple[Element, ...]) -> ArrayElement:
    first = column[0]
    constant = np.array([[e.constant] for e in column])
    terms = []
    for k, term in enumerate(first.terms):
        factor = np.array([[e.terms[k].factor] for e in column])
        index = np.array([e.terms[k].index for e in column], dtype=np.intp)
        terms.append(ArrayTerm(term.kind, index, None if np.all(factor == 1.0) else factor))
    return ArrayElement(
        first.turns,
        first.axis,
        constant if np.any(constant) else None,
        tuple(terms),
        np.array([[e.compliance] for e in column]) if first.compliance else None,
    )


def _group(machine: Machine, members: list[int]) -> Group:
    limbs = [machine.limbs[i] for i in members]
    elements = tuple(_element(column) for column in zip(*(b.elements for b in limbs), strict=True))
    count = len(limbs[0].joints)
    passive = np.array([[b.first_joint + j for b in limbs] for j in range(count)], dtype=np.intp)
    columns: list[list[tuple[int, Array | None]]] = [[] for _ in range(count)]
    for k, element in enumerate(elements):
        for term in element.terms:
            if term.kind == "passive":
                columns[int(term.index[0]) - limbs[0].first_joint].append((k, term.factor))
    return Group(
        tuple(members),
        elements,
        passive.reshape(count, len(members)),
        tuple(tuple(c) for c in columns),
        tuple(k for k, e in enumerate(elements) if e.compliance is not None),
        np.array(
            [[1.0 if machine.joints[j].turns else machine.size for j in row] for row in passive]
        ).reshape(count, len(members), 1),
        limbs[0].released,
        limbs[0].published_rows,
    )


@lru_cache(maxsize=64)
def compile_machine(machine: Machine) -> Compiled:
    """Group the limbs of a machine by structure; cached by identity of the machine."""
    members: dict[object, list[int]] = {}
    for i, limb in enumerate(machine.limbs):
        members.setdefault(_signature(limb), []).append(i)
    groups = tuple(_group(machine, indices) for indices in members.values())
    return Compiled(
        groups,
        sum(group.wrenches * group.count for group in groups),
        len(machine.joints),
        np.array([joint.start for joint in machine.joints]),
    )


def element_value(
    element: ArrayElement, parameters: Numbers, extension: Numbers, passive: Numbers
) -> Numbers | None:
    """Value of an element, (L, 1) or (L, N); None where it is nothing but zero.

    ``parameters`` (P, 1) or (P, N), ``extension`` (n, N), ``passive`` (n_joints, N).
    """
    value: Numbers | None = element.constant
    for term in element.terms:
        source = {"parameter": parameters, "actuator": extension, "passive": passive}[term.kind]
        part = source[term.index]
        if term.factor is not None:
            part = term.factor * part
        value = part if value is None else value + part
    return value
