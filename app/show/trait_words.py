"""What the parts of a machine are, and which effects hang on that, in words and as data."""

from typing import Any

from calib.effects import catalogue, not_defined
from calib.effects.legs import arm_between
from calib.effects.limb_frames import limb_labels, nominal_value
from calib.mechanism.description import Limb, Machine
from calib.mechanism.traits import UniversalJoint

BY_NAMES = "The file states no traits; these were told by its names, as in files of before."
NONE = (
    "The file states no traits: write [limb_types.NAME.traits] (docs/machine-files.md) to have\n"
    "effects of legs, rods, joints and screws asked."
)


def trait_data(machine: Machine) -> dict[str, Any]:
    """Traits of every chain, the effects that can be asked, and why others cannot."""
    labels = limb_labels(machine)
    return {
        "traits_stated": machine.traits_stated,
        "traits": {
            label: _traits(machine, limb) for label, limb in zip(labels, machine.limbs, strict=True)
        },
        "effects": [effect.id for effect in catalogue(machine)],
        "not_on_this_machine": not_defined(machine),
    }


def trait_words(machine: Machine) -> str:
    """The same for a person."""
    kinds: dict[str, list[str]] = {}
    for label, limb in zip(limb_labels(machine), machine.limbs, strict=True):
        kinds.setdefault(", ".join(_traits(machine, limb)), []).append(label)
    told = [f"  {', '.join(names)}: {text}" for text, names in kinds.items() if text]
    lines = ["Traits: what the parts are.", *told] if told else []
    if not machine.traits_stated:
        lines = [*lines, BY_NAMES] if told else [NONE]
    lines.append(f"Effects: {', '.join(effect.id for effect in catalogue(machine))}.")
    lines += [f"  not {name}: {why}" for name, why in not_defined(machine).items()]
    return "\n".join(lines)


def _traits(machine: Machine, limb: Limb) -> list[str]:
    """What the parts of one chain are."""
    traits, told = limb.traits, []
    if traits.grows:
        lengths = [_length(machine, limb, element) for element in traits.grows]
        told.append(f"grows over a length of {' + '.join(lengths)} mm")
    for where, joint in (("base", traits.base_joint), ("platform", traits.platform_joint)):
        if joint is not None:
            told.append(f"universal joint at the {where}{_arm(machine, limb, joint)}")
    if traits.screw is not None:
        told.append("a screw without a guide")
    if traits.sides:
        told.append("side of a parallelogram")
    if traits.platform_azimuth:
        told.append("platform joint at an azimuth")
    if traits.yields is not None:
        told.append(f"a spring of {limb.elements[traits.yields].compliance:g} mm/N")
    if traits.pulls is not None:
        told.append(f"a rope that only pulls, {limb.elements[traits.pulls].compliance:g} mm/N")
    return told


def _length(machine: Machine, limb: Limb, element: int) -> str:
    """Length of a part at home."""
    value = nominal_value(machine, limb, element)
    home = machine.extension(machine.home_q[:, None])[:, 0]
    for term in limb.elements[element].terms:
        if term.kind == "actuator":
            value += term.factor * float(home[term.index])
    return f"{abs(value):g}"


def _arm(machine: Machine, limb: Limb, joint: UniversalJoint) -> str:
    between = arm_between(machine, limb, joint)
    if not between:
        return " (its axes meet)"
    return f" (axes {sum(abs(nominal_value(machine, limb, k)) for k in between):g} mm apart)"
