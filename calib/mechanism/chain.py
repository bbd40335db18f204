"""A limb as one line of text.

A chain is a list of elements between the base frame and the platform frame, each along or about
a local axis::

    tx:B_x  rz:15d           fixed translation (mm) and rotation; d or deg for degrees
    Rx  Tz                   passive joints; Rx(90d) starts from 90 deg when the machine is closed
    psi=Rx(90d)              the same with a name, for its limits and for drawings
    Ty:q+L0                  a joint that the actuator q drives; L0 is a parameter
    Ty:5mm/turn*q            the same by a motor that turns, behind a screw
    Uxz  Sxyz  Cz            universal, spherical and cylindrical joints, spelled out in order
    Rz:?a ... Rz:-?a         two joints that share one passive coordinate (a parallelogram)
    upper=tz:300             any element may have a name: traits call it by that
    ctx:0.001  crz:1e-8      compliance at this place, mm/N or rad/(N mm)

A value is a sum of products: ``-2*e+15d`` (``calib.mechanism.chain_value``).
"""

import re
from dataclasses import dataclass, field

from calib.errors import BadInput
from calib.mechanism.chain_value import Meant, Resolve, read_value
from calib.mechanism.description import Element, PassiveJoint, Term
from calib.mechanism.traits import Part

_TOKEN = re.compile(
    r"(?:(?P<name>[A-Za-z]\w*)=)?"
    r"(?P<kind>ct|cr|[trTRUSC])(?P<axes>[xyz]{1,3})"
    r"(?:\((?P<start>[^)]*)\))?"
    r"(?::(?P<value>\S+))?"
)
_AXISLESS = re.compile(r"(?:[A-Za-z]\w*=)?[RTUSC](?:\(.*)?(?::.*)?")
_EXPECTED_AXES = {"U": 2, "S": 3}


@dataclass
class ChainNames:
    """Names of one chain: those of its elements, and those that stand in their values."""

    elements: dict[str, list[int]] = field(default_factory=dict)
    values: dict[str, list[Part]] = field(default_factory=dict)

    def all(self) -> list[str]:
        """Every name."""
        return [*self.elements, *self.values]


@dataclass
class ChainReader:
    """Turns the text of one limb's chain into elements and passive joints."""

    resolve: Resolve
    place: str
    first_joint: int
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=list)
    joints: list[PassiveJoint] = field(default_factory=list)
    shared: dict[str, int] = field(default_factory=dict)
    names: ChainNames = field(default_factory=ChainNames)

    def read(self, text: str) -> None:
        """Append the elements of ``text``; raises :class:`BadInput` naming the token."""
        for token in text.split():
            found = _TOKEN.fullmatch(token)
            if not found and _AXISLESS.fullmatch(token):
                raise BadInput(
                    f'"{token}" is a joint without an axis',
                    place=self.place,
                    remedy="Say about or along which local axis: Rx, Tz, Uxz, Sxyz.",
                )
            if not found:
                raise BadInput(
                    f'"{token}" is not an element of a chain',
                    place=self.place,
                    remedy="Write for example tx:B_x, rz:15d, Rx, psi=Rx(90d) or Ty:q+L0.",
                )
            self._element(token, found)

    def _element(self, token: str, found: re.Match[str]) -> None:
        kind, axes, value = found["kind"], found["axes"], found["value"]
        if len(axes) != _EXPECTED_AXES.get(kind, 1):
            raise BadInput(
                f'"{token}" names {len(axes)} axes, "{kind}" takes {_EXPECTED_AXES.get(kind, 1)}',
                place=self.place,
                remedy="U takes two axes (Uxz), S three (Sxyz), everything else one.",
            )
        letters = [axes] if kind not in "US" else list(axes)
        parts = [("R" if kind in "USC" else kind, axis) for axis in letters]
        if kind == "C":
            parts.append(("T", axes))
        starts = (found["start"] or "").split(",") if found["start"] else []
        if len(starts) > len(parts):
            raise BadInput(
                f'"{token}" has too many starting values',
                place=self.place,
                remedy=f"Give it {len(parts)}, apart by commas.",
            )
        for k, (part, axis) in enumerate(parts):
            name = found["name"] or ""
            label = name if len(parts) == 1 or not name else f"{name}.{part}{axis}"
            start = starts[k] if k < len(starts) else ""
            for called in dict.fromkeys(n for n in (name, label) if n):
                self.names.elements.setdefault(called, []).append(len(self.elements))
            self._append(token, part, "xyz".index(axis), label, start, value)

    def _append(
        self, token: str, kind: str, axis: int, name: str, start: str, value: str | None
    ) -> None:
        turns = kind in ("r", "R", "cr")
        unit = "rad" if turns else "mm"
        if kind in ("R", "T") and value is None:
            self._passive(turns, axis, name, start, token)
            return
        if value is None:
            raise BadInput(
                f'"{token}" has no value', place=self.place, remedy=f"Write {token}:VALUE."
            )
        if kind in ("ct", "cr"):
            self._compliance(token, turns, axis, value)
            return
        constant, terms = self._value(value, unit, token, joint=kind in ("R", "T"), turns=turns)
        moves = any(term.kind != "parameter" for term in terms)
        if moves != (kind in ("R", "T")):
            raise BadInput(
                f'"{token}" is a fixed element but moves'
                if moves
                else f'"{token}" is a joint whose value holds no actuator',
                place=self.place,
                remedy="Capital letters are joints, small letters fixed transforms.",
            )
        self.elements.append(Element(turns, axis, constant, tuple(terms)))

    def _compliance(self, token: str, turns: bool, axis: int, value: str) -> None:
        constant, terms = self._value(value, "", token, joint=False, turns=turns)
        if terms or constant <= 0.0:
            raise BadInput(
                f'"{token}" needs a positive number',
                place=self.place,
                remedy="Give the compliance in mm/N or rad/(N mm).",
            )
        self.elements.append(Element(turns, axis, compliance=constant))

    def _passive(self, turns: bool, axis: int, name: str, start: str, token: str) -> None:
        unit = "rad" if turns else "mm"
        value = 0.0
        if start:
            value = self._value(start, unit, token, joint=False, turns=turns, named=False)[0]
        label = name or f"joint{len(self.joints) + 1}"
        limits = self.limits.pop(label, (-float("inf"), float("inf")))
        term = Term("passive", self.first_joint + len(self.joints), 1.0)
        self.joints.append(PassiveJoint(label, value, limits, turns))
        self.elements.append(Element(turns, axis, 0.0, (term,)))

    def _value(
        self, text: str, unit: str, token: str, *, joint: bool, turns: bool, named: bool = True
    ) -> tuple[float, list[Term]]:
        def meant(name: str, place: str) -> Meant:
            if name.startswith("?") and joint:
                return Meant(self._shared(name[1:], turns), "rad" if turns else "mm")
            return self.resolve(name, place)

        value = read_value(text, unit, f'{self.place}, "{token}"', meant)
        if named:
            for name, factor in value.names:
                self.names.values.setdefault(name, []).append(Part(len(self.elements), factor))
        return value.constant, value.terms

    def _shared(self, name: str, turns: bool) -> Term:
        if name not in self.shared:
            self.shared[name] = self.first_joint + len(self.joints)
            limits = self.limits.pop(name, (-float("inf"), float("inf")))
            self.joints.append(PassiveJoint(name, 0.0, limits, turns))
        return Term("passive", self.shared[name], 1.0)
