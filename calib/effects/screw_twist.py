"""An unguided screw turns about its own axis as the joints swing, and so changes length.

extension_i = L / (2 pi) (twist_i - twist_i at home). The machine file says which joint the twist is
(trait ``screw``): the turn about the leg (base to platform, right-handed) from the base-side second
axis to the platform-side one.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.mechanism.description import Limb, Machine, Term
from calib.runs.stack import Rows
from calib.unknown import Unknown


class ScrewTwist(Effect):
    """One lead for all screws."""

    id = "screw-twist"
    kind = "machine"
    says = "an unguided screw turns about its own axis as the joints swing, and changes length"

    def lacking(self, machine: Machine) -> str:
        """Some leg must be a screw without a guide."""
        if any(limb.traits.screw is not None for limb in machine.limbs):
            return ""
        return "its file names no screw without a guide (trait screw)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``screw-twist.L``, mm per turn."""
        return (Unknown("screw-twist.L", "mm", 2.0),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Turns from home."""
        shape = np.zeros((1, *situation.rows.extension.shape))
        for limb in situation.machine.limbs:
            if limb.traits.screw is None:
                continue
            turn = _term(limb, "passive", limb.traits.screw)
            drive = _term(limb, "actuator")
            turned = situation.passive[turn.index] - situation.passive_home[turn.index]
            shape[0, drive.index] = turn.factor / drive.factor * turned / (2.0 * np.pi)
        return Signature(extension=shape)


def _term(limb: Limb, kind: str, element: int | None = None) -> Term:
    """The joint, or the actuator, of one element of a limb, or of whichever has one."""
    elements = limb.elements if element is None else limb.elements[element : element + 1]
    return next(term for e in elements for term in e.terms if term.kind == kind)


EFFECTS = (ScrewTwist(),)
