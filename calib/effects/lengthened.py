"""Parts of a limb that are longer or turned: what that does, driven or not."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.effects.component import Signature, Situation
from calib.mechanism.description import Element, Machine, Term
from calib.mechanism.traits import Part, Traits

PartsOf = Callable[[Traits], tuple[Part, ...]]
"""Which parts of a limb, by its traits."""


@dataclass(frozen=True, eq=False)
class Change:
    """Change ``shape`` (N,) of an element's value per unit of an unknown, mm or rad."""

    unknown: int
    limb: int
    element: int
    shape: Array


def lengthened(
    situation: Situation, changes: Sequence[Change], unknowns: int, *, closed_anew: bool = False
) -> Signature:
    """What the changes of elements do: an extension where an actuator drives, else a twist.

    Parameters
    ----------
    situation : Situation
    changes : sequence of Change
        Several of one unknown add up.
    unknowns : int
        Number U of unknowns.
    closed_anew : bool
        Changes of whole millimetres: where a parameter of its own stands in the element, it is
        changed and the machine closed anew, since twists add up to first order only.
    """
    machine, count = situation.machine, situation.rows.count
    extension = np.zeros((unknowns, len(machine.actuators), count))
    parameters = np.zeros((unknowns, len(machine.parameters), count)) if closed_anew else None
    fixed = []
    for change in changes:
        element = machine.limbs[change.limb].elements[change.element]
        own = own_parameter(machine, element)
        driven = [term for term in element.terms if term.kind == "actuator"]
        for term in driven:
            extension[change.unknown, term.index] += change.shape / (term.factor * len(driven))
        if parameters is not None and own is not None and not driven:
            parameters[change.unknown, own.index] += change.shape / own.factor
        elif not driven:
            fixed.append(change)
    twist = np.zeros((unknowns, 6, count))
    places = [(change.limb, change.element) for change in fixed]
    for change, moved in zip(fixed, situation.element_twists(places), strict=True):
        twist[change.unknown] += change.shape * moved
    return Signature(
        extension=extension if np.any(extension) or not fixed else None,
        parameters=parameters if parameters is not None and np.any(parameters) else None,
        twist=twist if fixed else None,
    )


def limbs_with(machine: Machine, parts_of: PartsOf) -> list[str]:
    """Names of the limbs that have such parts; the chains of one limb share its name."""
    return list(dict.fromkeys(limb.name for limb in machine.limbs if parts_of(limb.traits)))


def by_limb(situation: Situation, parts_of: PartsOf) -> Signature:
    """One unknown for each of :func:`limbs_with`: these parts of all its chains change together."""
    machine, count = situation.machine, situation.rows.count
    names = limbs_with(machine, parts_of)
    changes = [
        Change(names.index(limb.name), number, part.element, np.full(count, part.factor))
        for number, limb in enumerate(machine.limbs)
        for part in parts_of(limb.traits)
    ]
    return lengthened(situation, changes, len(names))


def own_parameter(machine: Machine, element: Element) -> Term | None:
    """The calibrated parameter that stands in this element and in no other; None without one."""
    held = [term for term in element.terms if term.kind == "parameter"]
    if len(held) != 1:
        return None
    places = sum(
        term.kind == "parameter" and term.index == held[0].index
        for limb in machine.limbs
        for other in limb.elements
        for term in other.terms
    )
    return held[0] if places == 1 else None
