"""An axis is an actuator as errors along it are spoken of: its name, its unit, what is usual.

Every effect, formula and search that goes actuator by actuator takes names, units and sizes from
here, so that a machine with linear and rotary actuators has each in its own unit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calib.arrays import IntArray

if TYPE_CHECKING:
    from calib.mechanism.description import Actuator, Limb


@dataclass(frozen=True)
class Axis:
    """What is usual along one actuator, in the actuator's own unit.

    Attributes
    ----------
    name : str
        Unique in the machine: that of the limb, where the actuator drives this limb alone and
        nothing else drives it; else the actuator's own.
    unit : "mm" or "rad"
    moves, ratio : "mm" or "rad", float
        Unit of the joint that it drives, and how far the joint goes per ``unit`` of the actuator:
        1 but behind a screw or a gear.
    usual_error : float
        How large an error along the axis may reasonably be.
    lost_motion : float
        The same of what is lost when the axis turns round.
    motion : float
        Changes of the commanded coordinate up to this are rounding, not motion.
    shortest, longest : float
        Periods between which a periodic error is searched for.
    compliance : float
        How far the axis may reasonably yield, in ``unit`` per N or per N mm
        (``compliance_unit``).
    """

    name: str
    unit: str
    moves: str
    ratio: float
    usual_error: float
    lost_motion: float
    motion: float
    shortest: float
    longest: float
    compliance: float

    @property
    def kind(self) -> str:
        """Whether the actuator is linear (mm) or rotary (rad)."""
        return "linear" if self.unit == "mm" else "rotary"

    @property
    def compliance_unit(self) -> str:
        """Unit of a yield: mm/N or rad/(N mm)."""
        return "mm/N" if self.unit == "mm" else "rad/(N mm)"


@dataclass(frozen=True)
class _Usual:
    """The same of a joint that slides (mm) or turns (rad)."""

    error: float
    lost_motion: float
    motion: float
    shortest: float
    longest: float
    compliance: float


_TURN = 2.0 * np.pi
_USUAL: Mapping[str, _Usual] = {
    "mm": _Usual(0.01, 0.02, 1e-4, 1.0, 25.0, 1e-4),
    "rad": _Usual(1e-4, 1e-4, 1e-6, _TURN / 200.0, _TURN, 1e-8),
}


def axes_of(actuators: "Sequence[Actuator]", limbs: "Sequence[Limb]") -> tuple[Axis, ...]:
    """One axis for each actuator, in order."""
    names = _names(actuators, limbs)
    joints: list[list[tuple[str, float]]] = [[] for _ in actuators]
    for limb in limbs:
        for element in limb.elements:
            for term in element.terms:
                if term.kind == "actuator" and term.factor:
                    unit = "rad" if element.turns else "mm"
                    joints[term.index].append((unit, abs(term.factor)))
    return tuple(
        _axis(name, actuator.unit, own or [(actuator.unit, 1.0)])
        for name, actuator, own in zip(names, actuators, joints, strict=True)
    )


def units_of(axes: Sequence[Axis]) -> dict[str, IntArray]:
    """Unit -> indices of the axes in it, linear ones first."""
    units = [axis.unit for axis in axes]
    return {
        unit: np.array([k for k, own in enumerate(units) if own == unit], dtype=np.intp)
        for unit in sorted(set(units))
    }


def _axis(name: str, unit: str, joints: list[tuple[str, float]]) -> Axis:
    """What is usual at the joint, brought to the actuator; of several joints the most touchy."""
    moves, ratio = min(joints, key=lambda joint: _USUAL[joint[0]].error / joint[1])
    usual = _USUAL[moves]
    shortest, longest = usual.shortest / ratio, usual.longest / ratio
    if unit == "rad":
        # Whatever is behind it, the motor itself turns.
        shortest, longest = min(shortest, _TURN), max(longest, _TURN)
    return Axis(
        name=name,
        unit=unit,
        moves=moves,
        ratio=ratio,
        usual_error=usual.error / ratio,
        lost_motion=usual.lost_motion / ratio,
        motion=_USUAL[unit].motion,
        shortest=shortest,
        longest=longest,
        compliance=usual.compliance / ratio**2,
    )


def _names(actuators: "Sequence[Actuator]", limbs: "Sequence[Limb]") -> list[str]:
    drives: list[set[str]] = [set() for _ in actuators]
    driven: dict[str, set[int]] = {}
    for limb in limbs:
        for element in limb.elements:
            for term in element.terms:
                if term.kind == "actuator":
                    drives[term.index].add(limb.name)
                    driven.setdefault(limb.name, set()).add(term.index)
    own = [actuator.name for actuator in actuators]
    names = [
        next(iter(limbs_of)) if len(limbs_of) == 1 and driven[next(iter(limbs_of))] == {k} else name
        for k, (limbs_of, name) in enumerate(zip(drives, own, strict=True))
    ]
    # A limb may be called as another limb's actuator is.
    return names if len(set(names)) == len(names) else own
