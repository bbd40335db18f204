"""The azimuth of a platform joint is not the one that belongs to its limb."""

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.lengthened import by_limb, limbs_with
from calib.mechanism.description import Machine
from calib.mechanism.traits import Part, Traits
from calib.runs.stack import Rows
from calib.unknown import Unknown


class JointAzimuth(Effect):
    """Azimuth of the platform joint less that of the slider, one for each limb."""

    id = "joint-azimuth"
    kind = "machine"
    says = "a platform joint's azimuth differs from its slider's"

    def lacking(self, machine: Machine) -> str:
        """Some platform joint must stand at an azimuth that is not calibrated by itself."""
        if not _limbs(machine):
            return "its file names no azimuth of a platform joint (trait platform_azimuth)"
        held = [
            machine.parameters[term.index].name
            for limb in machine.limbs
            for part in limb.traits.platform_azimuth
            for term in limb.elements[part.element].terms
            if term.kind == "parameter"
        ]
        return f"it is calibrated already ({', '.join(dict.fromkeys(held))})" if held else ""

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-azimuth.limb1`` ..., rad."""
        return tuple(Unknown(f"joint-azimuth.{name}", "rad", 1e-3) for name in _limbs(rows.machine))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each limb alone."""
        return alone(len(_limbs(rows.machine)))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Turn of the joint's frame on the platform, in every chain of the limb."""
        return by_limb(situation, _azimuth)


def _limbs(machine: Machine) -> list[str]:
    """Limbs whose platform joint stands at an azimuth."""
    return limbs_with(machine, _azimuth)


def _azimuth(traits: Traits) -> tuple[Part, ...]:
    return traits.platform_azimuth


EFFECTS = (JointAzimuth(),)
