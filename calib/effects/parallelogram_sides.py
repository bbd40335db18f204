"""The two long sides of a parallelogram differ: the platform turns.

A difference acts through the closure as it is, elastic where the machine is over-constrained
(Feng et al. 2022).
"""

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.lengthened import by_limb, limbs_with
from calib.mechanism.description import Machine
from calib.mechanism.traits import Part, Traits
from calib.runs.stack import Rows
from calib.unknown import Unknown

TOLERANCE_MM = 0.2
"""Standard deviation of a difference; it alone holds what all limbs share, which moves nothing."""


class ParallelogramSides(Effect):
    """Difference of the two long sides, one for each limb."""

    id = "parallelogram-sides"
    kind = "machine"
    says = "the two long sides of a parallelogram differ, and the platform turns"

    def lacking(self, machine: Machine) -> str:
        """There must be parallelograms whose sides are not calibrated one by one."""
        if not _limbs(machine):
            return "its file names no parallelogram"
        for name in _limbs(machine):
            calibrated = _own_parameters(machine, name)
            if calibrated:
                return f"both sides are calibrated already ({', '.join(calibrated)})"
        return ""

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``parallelogram-sides.limb1`` ..., mm: side 1 less side 2."""
        return tuple(
            Unknown(f"parallelogram-sides.{name}", "mm", 0.05, sigma=TOLERANCE_MM)
            for name in _limbs(rows.machine)
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each limb alone."""
        return alone(len(_limbs(rows.machine)))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Half a difference longer on one side, half shorter on the other."""
        return by_limb(situation, _sides)


def _limbs(machine: Machine) -> list[str]:
    """Limbs that are parallelograms."""
    return limbs_with(machine, _sides)


def _sides(traits: Traits) -> tuple[Part, ...]:
    return traits.sides


def _own_parameters(machine: Machine, name: str) -> list[str]:
    """Calibrated parameters in one side of a parallelogram that the other side has not."""
    held = [
        {t.index for t in limb.elements[side.element].terms if t.kind == "parameter"}
        for limb in machine.limbs
        if limb.name == name
        for side in limb.traits.sides
    ]
    shared = {index for index in held[0] if all(index in other for other in held)}
    own = sorted({index for one in held for index in one} - shared)
    return [machine.parameters[index].name for index in own]


EFFECTS = (ParallelogramSides(),)
