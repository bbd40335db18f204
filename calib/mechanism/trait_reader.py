"""The table ``traits`` of a limb: names of its chain -> what they are.

::

    [limb_types.leg.traits]
    grows = ["L0"]                           # legs, rods, links
    base_joint = ["psi_B", "swing_B"]        # or the name of a joint Uxy
    platform_joint = ["psi_P", "swing_P"]
    screw = "twist"
    parallelogram = ["dh1", "dh2"]
    platform_azimuth = "dtheta_Bz"
    yields = "spring"
    masses = { upper = { behind = "q2", mass_kg = 8.4, com = [0.0, 0.0, 212.0] } }

A name is that of an element (``leg=Ty:q+L0``), or of what stands in its value (``q``, ``L0``).
"""

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from calib.mechanism.chain import ChainNames
from calib.mechanism.description import Element, Limb
from calib.mechanism.traits import LinkMass, Part, Traits, UniversalJoint
from calib.toml_table import TomlTable

KEYS = (
    "grows", "base_joint", "platform_joint", "screw", "parallelogram", "platform_azimuth", "yields",
    "pulls",
)  # fmt: skip
MASSES = "masses"


def has_role(element: Element, kind: str) -> bool:
    """Whether a passive joint ("passive") or an actuator ("actuator") moves an element."""
    return any(term.kind == kind for term in element.terms)


@dataclass
class TraitReader:
    """Reads the traits of one limb; every fault is named with its line and a remedy."""

    table: TomlTable
    limb: str
    limbs: Sequence[Limb]
    names: Sequence[ChainNames]
    nominal: Sequence[float]
    """Nominal values of the parameters, by index."""

    def read(self) -> list[Limb]:
        """The limbs (one for each chain) with their traits."""
        self.table.only(*KEYS, MASSES)
        table = {
            key: self.table.raw(key, "text or list of texts") for key in self.table if key != MASSES
        }
        for key, value in table.items():
            self._check_names(key, value)
        return [
            replace(limb, traits=self._traits(table, chain))
            for chain, limb in enumerate(self.limbs)
        ]

    def _traits(self, table: Mapping[str, Any], chain: int) -> Traits:
        return Traits(
            grows=tuple(
                part.element
                for name in self._listed("grows", table)
                for part in self._parts("grows", name, chain, "length")
            ),
            base_joint=self._joint("base_joint", table, chain),
            platform_joint=self._joint("platform_joint", table, chain),
            screw=self._screw(table, chain),
            sides=self._sides(table, chain),
            platform_azimuth=tuple(
                part
                for name in self._listed("platform_azimuth", table)
                for part in self._parts("platform_azimuth", name, chain, "fixed turn")
            ),
            yields=self._spring("yields", table, chain),
            pulls=self._spring("pulls", table, chain),
            masses=tuple(self._masses(chain)),
        )

    def _masses(self, chain: int) -> Iterator[LinkMass]:
        """Masses of links; only where every joint of the chain is driven."""
        named = self.table.named(MASSES, required=False)
        if named.names() and (self.limbs[chain].joints or len(self.limbs) > 1):
            raise self._fail(
                MASSES,
                f'limb "{self.limb}" has joints without an actuator',
                "Masses of links are for arms, whose joints are all driven; what a platform "
                "weighs stands in [load] of a run.",
            )
        for key in named:
            about = named.table(key)
            about.only("behind", "mass_kg", "com")
            self._check_names(MASSES, about.text("behind"))
            names = self.names[chain]
            name = about.text("behind")
            places = names.elements.get(name) or [p.element for p in names.values.get(name, [])]
            x, y, z = about.numbers("com", 3)
            yield LinkMass(max(places), about.number("mass_kg", above=0.0), (x, y, z))

    def _check_names(self, key: str, value: object) -> None:
        """Every name must stand in a chain of the limb."""
        known = [name for names in self.names for name in names.all()]
        listed = [value] if isinstance(value, str) else value
        if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
            raise self._fail(
                key, f"{key} is {value!r}", "Write a name of the chain, or a list of names."
            )
        for name in listed:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                raise self._fail(
                    key,
                    f'the chain of limb "{self.limb}" holds nothing named "{name}"',
                    f'Did you mean "{near[0]}"?'
                    if near
                    else f"Give the element a name: {name}=tz:300.",
                )

    def _fail(self, key: str, what: str, remedy: str) -> Exception:
        return self.table.wrong(what, key, remedy=remedy)

    @staticmethod
    def _listed(key: str, table: Mapping[str, Any]) -> list[str]:
        value = table.get(key, [])
        return [value] if isinstance(value, str) else list(value)

    def _parts(self, key: str, name: str, chain: int, wanted: str) -> list[Part]:
        """Where a name stands in a chain; refuses elements that cannot be what is ``wanted``."""
        names, elements = self.names[chain], self.limbs[chain].elements
        if name in names.elements:
            parts = [Part(k, self._sign(elements[k])) for k in names.elements[name]]
        else:
            parts = names.values.get(name, [])
        for part in parts:
            element = elements[part.element]
            fixed = not has_role(element, "passive") and not element.compliance
            fits = {
                "length": fixed and not element.turns,
                "fixed turn": fixed and element.turns and not has_role(element, "actuator"),
                "passive turn": element.turns and has_role(element, "passive"),
                "spring": bool(element.compliance) and not element.turns,
            }[wanted]
            if not fits:
                remedy = {
                    "length": "Name translations: L0 in Ty:q+L0, or upper=tz:300.",
                    "fixed turn": "Name a fixed rotation: rz:-corner.",
                    "passive turn": "Name a joint without an actuator: twist=Ry, or foot=Uxy.",
                    "spring": "Name a compliance along the rod: spring=ctz:1e-5.",
                }[wanted]
                raise self._fail(key, f'"{name}" in limb "{self.limb}" is no {wanted}', remedy)
        return parts

    def _sign(self, element: Element) -> float:
        value = element.constant + sum(
            term.factor * self.nominal[term.index]
            for term in element.terms
            if term.kind == "parameter"
        )
        return -1.0 if value < 0.0 else 1.0

    def _joint(self, key: str, table: Mapping[str, Any], chain: int) -> UniversalJoint | None:
        found = [
            part.element
            for name in self._listed(key, table)
            for part in self._parts(key, name, chain, "passive turn")
        ]
        if not found:
            return None
        if len(found) != 2:
            raise self._fail(
                key,
                f'{key} of limb "{self.limb}" has {len(found)} axes, a universal joint has two',
                f'Write {key} = ["psi", "swing"], or the name of a joint: foot=Uxy.',
            )
        written = isinstance(table[key], list) and len(table[key]) == 2
        first, second = found if written or key == "base_joint" else reversed(found)
        if (first < second) != (key == "base_joint"):
            body = key.removesuffix("_joint")
            raise self._fail(
                key,
                f'the axes of {key} of limb "{self.limb}" are not in their order',
                f"First comes the axis that is fixed to the {body}, then the one next to the leg.",
            )
        return UniversalJoint(first, second)

    def _screw(self, table: Mapping[str, Any], chain: int) -> int | None:
        found = [
            part.element
            for name in self._listed("screw", table)
            for part in self._parts("screw", name, chain, "passive turn")
        ]
        if not found:
            return None
        elements = self.limbs[chain].elements
        driven = [
            k for k, e in enumerate(elements) if has_role(e, "actuator") and not e.turns
        ]  # fmt: skip
        turn = found[0]
        between = elements[slice(*sorted((turn, driven[0])))] if driven else ()
        if (
            len(found) != 1
            or len(driven) != 1
            or elements[turn].axis != elements[driven[0]].axis
            or any(e.turns and e.axis != elements[turn].axis for e in between)
        ):
            raise self._fail(
                "screw",
                f'limb "{self.limb}" does not turn about the axis along which it is driven',
                "Name the joint that turns the screw about itself: twist=Ry beside Ty:q+L0.",
            )
        return turn

    def _sides(self, table: Mapping[str, Any], chain: int) -> tuple[Part, ...]:
        names = self._listed("parallelogram", table)
        if names and (len(names) != 2 or names[0] == names[1]):
            raise self._fail(
                "parallelogram",
                f'a parallelogram has two long sides, limb "{self.limb}" names {len(names)}',
                'Write parallelogram = ["side_a", "side_b"].',
            )
        return tuple(
            Part(part.element, half * part.factor)
            for name, half in zip(names, (0.5, -0.5), strict=False)
            for part in self._parts("parallelogram", name, chain, "length")
        )

    def _spring(self, key: str, table: Mapping[str, Any], chain: int) -> int | None:
        found = [
            part.element
            for name in self._listed(key, table)
            for part in self._parts(key, name, chain, "spring")
        ]
        if len(found) > 1:
            raise self._fail(
                key,
                f'limb "{self.limb}" names {len(found)} springs in one chain',
                "Name the one along the rod; the others yield in the file's proportion to it.",
            )
        return found[0] if found else None
