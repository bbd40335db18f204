"""Traits of machine files that state none: told by the names that effects once hung on.

Files that were written before traits existed, copies of the shipped ones above all, keep their
effects in this way. A file with one table ``traits`` is taken at its word instead.
"""

from collections.abc import Sequence
from dataclasses import replace

from calib.mechanism.chain import ChainNames
from calib.mechanism.description import Actuator, Limb, Parameter
from calib.mechanism.traits import Part, Traits, UniversalJoint

LINKS = ("1dx2", "1dy2", "4dx5", "4dz5")
"""Error sources along the links of a limb of two links; the rod of a limb without 4dz5: 3dz4."""
RODS = ("dh1", "dh2", "dtheta_Bz", "h")
"""Parameters of a limb that is a parallelogram of two rods."""


def traits_by_name(
    limbs: Sequence[Limb],
    names: Sequence[ChainNames],
    parameters: Sequence[Parameter],
    actuators: Sequence[Actuator],
) -> tuple[Limb, ...]:
    """The limbs with the traits that their names tell; ``names`` are those of each limb."""
    known = {parameter.name for parameter in parameters}
    driven = [
        limb.name
        for limb in limbs
        if any(term.kind == "actuator" for element in limb.elements for term in element.terms)
    ]
    if all(a.unit == "mm" and isinstance(a.reference, str) for a in actuators):
        kind = _leg
    elif all(f"{name}.{part}" in known for name in driven for part in RODS):
        kind = _rods
    elif any(name.endswith(".4dz5") for name in known):
        kind = _links
    else:
        kind = _nothing
    joints = len(limbs) == len(actuators)
    told = []
    for limb, own in zip(limbs, names, strict=True):
        traits = kind(limb, own, actuators)
        told.append(replace(limb, traits=_with_joints(traits, own) if joints else traits))
    return tuple(told)


def _where(names: ChainNames, name: str) -> tuple[int, ...]:
    return tuple(part.element for part in names.values.get(name, []))


def _joint(names: ChainNames, first: str, second: str) -> UniversalJoint | None:
    if first not in names.elements or second not in names.elements:
        return None
    return UniversalJoint(names.elements[first][0], names.elements[second][0])


def _with_joints(traits: Traits, names: ChainNames) -> Traits:
    return replace(
        traits,
        base_joint=_joint(names, "psi_B", "swing_B"),
        platform_joint=_joint(names, "psi_P", "swing_P"),
        screw=next(iter(names.elements.get("twist", [])), None),
    )


def _nothing(limb: Limb, names: ChainNames, actuators: Sequence[Actuator]) -> Traits:
    del limb, names, actuators
    return Traits()


def _leg(limb: Limb, names: ChainNames, actuators: Sequence[Actuator]) -> Traits:
    """Actuators that are legs: where they and their reference, a length, stand in the chain."""
    found: set[int] = set()
    for k, element in enumerate(limb.elements):
        for term in element.terms:
            if term.kind == "actuator" and not element.turns:
                length = str(actuators[term.index].reference).rpartition(".")[2]
                found |= {k, *_where(names, length)}
    return Traits(grows=tuple(sorted(found)))


def _rods(limb: Limb, names: ChainNames, actuators: Sequence[Actuator]) -> Traits:
    """Parallelograms of two rods that are springs."""
    del actuators
    springs = [k for k, e in enumerate(limb.elements) if e.compliance and not e.turns]
    return Traits(
        grows=_where(names, "h"),
        sides=tuple(
            Part(part.element, half * part.factor)
            for name, half in (("dh1", 0.5), ("dh2", -0.5))
            for part in names.values.get(name, [])
        ),
        platform_azimuth=tuple(names.values.get("dtheta_Bz", [])),
        yields=springs[0] if springs else None,
    )


def _links(limb: Limb, names: ChainNames, actuators: Sequence[Actuator]) -> Traits:
    """Constant translations beside the error sources of the links, with no turn between."""
    del actuators
    found = []
    for name in LINKS if "4dz5" in names.values else ("3dz4",):
        for at in _where(names, name):
            first = last = at
            while first > 0 and not limb.elements[first - 1].turns:
                first -= 1
            while last + 1 < len(limb.elements) and not limb.elements[last + 1].turns:
                last += 1
            found += [
                k
                for k in range(first, last + 1)
                if limb.elements[k].axis == limb.elements[at].axis and limb.elements[k].constant
            ]
    return Traits(grows=tuple(dict.fromkeys(found)))
