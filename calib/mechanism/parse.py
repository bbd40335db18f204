"""Machine file (TOML text) -> :class:`Machine`. Every fault is named with its line and remedy."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calib.errors import BadInput
from calib.mechanism.chain import ChainReader
from calib.mechanism.description import (
    Actuator,
    Limb,
    Machine,
    Parameter,
    Task,
    Term,
)
from calib.mechanism.hidden import with_hidden_apart
from calib.quantity import quantity
from calib.toml_place import line_of, load_toml

FORMAT = "pkm-machine/1"
POSE = ("x", "y", "z", "rx", "ry", "rz")
_POINTING = ("tilt", "azimuth")
_TOP = (
    "format", "name", "says", "source", "home", "task", "workspace", "parameters", "actuators",
    "limb_types", "limbs", "effects", "drawing", "closure", "nests",
)  # fmt: skip
_TYPE_KEYS = ("chain", "chains", "parameters", "joints", "says")
_PARAMETER_KEYS = ("unit", "tolerance", "sigma", "nominal", "says", "hidden")
_ACTUATOR_KEYS = ("unit", "reference", "home", "limits", "says")
_LIMB_KEYS = ("type", "chain", "chains", "parameters", "joints", "says")


def parse_machine(text: str, source: str) -> Machine:
    """Read a machine.

    Parameters
    ----------
    text : str
        TOML text, format ``pkm-machine/1`` (docs/machine-files.md).
    source : str
        Name of the file, for error messages.

    Raises
    ------
    BadInput
        Naming the file, the line, what was found and the remedy.
    """
    return _Reader(text, source, load_toml(text, source)).machine()


def _unit_of(name: str) -> str:
    return "mm" if name in ("x", "y", "z") else "rad"


@dataclass
class _Reader:
    text: str
    source: str
    data: dict[str, Any]
    parameters: list[Parameter] = field(default_factory=list)
    index: dict[str, int] = field(default_factory=dict)
    actuators: list[Actuator] = field(default_factory=list)
    joints: int = 0

    def place(self, *keys: str) -> str:
        return f"{self.source}, line {line_of(self.text, *keys)}"

    def fail(self, what: str, *keys: str, remedy: str = "") -> BadInput:
        return BadInput(what, place=self.place(*keys), remedy=remedy)

    def known(self, table: Mapping[str, Any], allowed: tuple[str, ...], *keys: str) -> None:
        for key in table:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                hint = f'Did you mean "{near[0]}"?' if near else f"Known: {', '.join(allowed)}."
                raise self.fail(f'unknown key "{key}"', *keys, key, remedy=hint)

    def table(self, *keys: str) -> dict[str, Any]:
        node: Any = self.data
        for key in keys:
            node = node.get(key, {})
            if not isinstance(node, dict):
                raise self.fail(f'"{key}" must be a table', *keys)
        return dict(node)

    def text_of(self, table: Mapping[str, Any], key: str, *keys: str, default: str = "") -> str:
        value = table.get(key, default)
        if not isinstance(value, str):
            raise self.fail(f'"{key}" must be text', *keys, key)
        return value

    def machine(self) -> Machine:
        if self.data.get("format") != FORMAT:
            raise self.fail(
                f"format is {self.data.get('format')!r}",
                "format",
                remedy=f'Write format = "{FORMAT}".',
            )
        self.known(self.data, _TOP)
        name = self.text_of(self.data, "name")
        if not name:
            raise self.fail("the machine has no name", remedy='Write name = "my-machine".')
        for key, spec in self.table("actuators").items():
            self.actuators.append(self.actuator(key, spec))
        if not self.actuators:
            raise self.fail("no actuator is described", remedy="Add a table [actuators].")
        for key, spec in self.table("parameters").items():
            self.add_parameter(key, spec, ("parameters", key), None)
        limb_tables = self.table("limbs")
        if not limb_tables:
            raise self.fail("no limb is described", remedy="Add tables [limbs.NAME].")
        limbs = tuple(limb for key in limb_tables for limb in self.limb(key, limb_tables[key]))
        self.check_references(limbs)
        home = self.home()
        machine = Machine(
            name=name,
            says=self.text_of(self.data, "says"),
            source=self.source,
            limbs=limbs,
            parameters=tuple(self.parameters),
            actuators=tuple(self.actuators),
            task=self.task(),
            home=home,
            workspace=self.workspace(),
            size=self.size(limbs, home),
            extra={
                k: self.data[k]
                for k in ("effects", "drawing", "closure", "nests")
                if k in self.data
            },
        )
        return with_hidden_apart(machine)

    def number(self, value: object, unit: str, *keys: str) -> float:
        return quantity(value, unit, self.place(*keys))

    def pair(self, value: object, unit: str, *keys: str) -> tuple[float, float]:
        if not isinstance(value, list) or len(value) != 2:
            raise self.fail(f"{value!r} is not [low, high]", *keys)
        low, high = (self.number(v, unit, *keys) for v in value)
        if low >= high:
            raise self.fail(f"the lower limit {low:g} is not below the upper {high:g}", *keys)
        return low, high

    def actuator(self, name: str, spec: Any) -> Actuator:
        keys = ("actuators", name)
        if not isinstance(spec, dict):
            raise self.fail(f'actuator "{name}" must be a table', *keys)
        self.known(spec, _ACTUATOR_KEYS, *keys)
        unit = self.text_of(spec, "unit", *keys)
        if unit not in ("mm", "rad"):
            raise self.fail(f'unknown unit "{unit}"', *keys, remedy="An actuator is in mm or rad.")
        for key in ("home", "limits"):
            if key not in spec:
                raise self.fail(f'actuator "{name}" has no {key}', *keys, remedy=f"Add {key} = ...")
        reference = spec.get("reference", 0.0)
        is_name = (
            isinstance(reference, str)
            and not reference[:1].isdigit()
            and reference[:1] not in "+-."
        )
        limits = self.pair(spec["limits"], unit, *keys)
        home = self.number(spec["home"], unit, *keys)
        if not limits[0] <= home <= limits[1]:
            raise self.fail(
                f"home {home:g} of {name} is outside its limits {limits[0]:g}..{limits[1]:g}", *keys
            )
        return Actuator(
            name, unit, home, limits, reference if is_name else self.number(reference, unit, *keys)
        )

    def add_parameter(
        self, name: str, spec: Any, keys: tuple[str, ...], bound: object | None
    ) -> None:
        if not isinstance(spec, dict):
            raise self.fail(
                f'parameter "{name}" must be a table', *keys, remedy='{ unit = "mm", ... }'
            )
        self.known(spec, _PARAMETER_KEYS, *keys)
        unit = self.text_of(spec, "unit", *keys)
        if unit not in ("mm", "rad"):
            raise self.fail(f'unknown unit "{unit}"', *keys, remedy="A parameter is in mm or rad.")
        given = bound if bound is not None else spec.get("nominal")
        if given is None:
            raise self.fail(
                f'parameter "{name}" has no nominal value',
                *keys,
                remedy="Set it in the limb's table.",
            )
        tolerance = self.number(spec.get("tolerance", 0.0), unit, *keys)
        sigma = self.number(spec.get("sigma", tolerance / np.sqrt(3.0)), unit, *keys)
        if sigma <= 0.0 or tolerance < 0.0:
            raise self.fail(
                f'parameter "{name}" has no positive tolerance',
                *keys,
                remedy="Give tolerance (uniform half-width) or sigma; a fixed value is a constant.",
            )
        if name in self.index:
            raise self.fail(f'parameter "{name}" is described twice', *keys)
        self.index[name] = len(self.parameters)
        self.parameters.append(
            Parameter(
                name,
                self.number(given, unit, *keys),
                unit,
                tolerance or float(sigma * np.sqrt(3.0)),
                float(sigma),
                self.text_of(spec, "says", *keys),
                spec.get("hidden") is True,
            )
        )

    def limb(self, name: str, spec: Any) -> list[Limb]:
        """A limb, or the several that go by one name (the rods of a parallelogram)."""
        keys = ("limbs", name)
        if not isinstance(spec, dict):
            raise self.fail(f'limb "{name}" must be a table', *keys)
        kind_name = self.text_of(spec, "type", *keys)
        types = self.table("limb_types")
        if kind_name and kind_name not in types:
            raise self.fail(
                f'limb type "{kind_name}" is not described',
                *keys,
                "type",
                remedy=f"Known: {', '.join(types)}.",
            )
        kind = types.get(kind_name, {})
        self.known(kind, _TYPE_KEYS, "limb_types", kind_name)
        chains, chain_place = self.chains(name, spec, kind_name, kind)
        declared = {**kind.get("parameters", {}), **spec.get("parameters", {})}
        for key, description in declared.items():
            place = (*keys, key) if key in spec else ("limb_types", kind_name, "parameters", key)
            self.add_parameter(f"{name}.{key}", description, place, spec.get(key))
        used: set[str] = set()
        limits = self.joint_limits(kind_name, kind, spec, keys)
        limbs, unknown = [], dict(limits)
        for chain in chains:
            reader = ChainReader(
                lambda symbol, unit, place: self.resolve(
                    name, spec, declared, used, symbol, unit, place
                ),
                f"{chain_place}, limb {name}",
                self.joints,
                dict(limits),
            )
            reader.read(chain)
            unknown = {joint: v for joint, v in unknown.items() if joint in reader.limits}
            self.joints += len(reader.joints)
            first = self.joints - len(reader.joints)
            limbs.append(Limb(name, tuple(reader.elements), tuple(reader.joints), first))
        self.check_names(name, spec, declared, used, unknown)
        return limbs

    def chains(
        self, name: str, spec: Mapping[str, Any], kind_name: str, kind: Mapping[str, Any]
    ) -> tuple[list[str], str]:
        """The chains of a limb and where they stand."""
        own = "chain" in spec or "chains" in spec
        table, keys = (spec, ("limbs", name)) if own else (kind, ("limb_types", kind_name))
        if "chains" in table:
            chains = table["chains"]
            if not isinstance(chains, list) or not all(isinstance(c, str) for c in chains):
                raise self.fail("chains is a list of chains", *keys, "chains")
            return chains, self.place(*keys, "chains")
        chain = self.text_of(table, "chain", *keys)
        if not chain:
            raise self.fail(
                f'limb "{name}" has no chain',
                "limbs",
                name,
                remedy='Write chain = "tx:... Rx ...".',
            )
        return [chain], self.place(*keys, "chain")

    def joint_limits(
        self,
        kind_name: str,
        kind: Mapping[str, Any],
        spec: Mapping[str, Any],
        keys: tuple[str, ...],
    ) -> dict[str, tuple[float, float]]:
        limits = {}
        for table, where in (
            (kind.get("joints", {}), ("limb_types", kind_name, "joints")),
            (spec.get("joints", {}), (*keys, "joints")),
        ):
            for joint, value in table.items():
                self.known(value, ("limits", "says"), *where, joint)
                limits[joint] = self.pair(value.get("limits"), "", *where, joint)
        return limits

    def resolve(
        self,
        limb: str,
        spec: Mapping[str, Any],
        declared: Mapping[str, Any],
        used: set[str],
        symbol: str,
        unit: str,
        place: str,
    ) -> Term | float:
        names = [a.name for a in self.actuators]
        used.add(symbol)
        if symbol in declared:
            return self.parameter_term(f"{limb}.{symbol}", unit, place)
        bound = spec.get(symbol)
        if isinstance(bound, str) and (bound in names or bound in self.index):
            symbol = bound
        elif isinstance(bound, str) and bound.isidentifier():
            raise self.fail(
                f'"{bound}" is no actuator of this machine',
                "limbs", limb, symbol,
                remedy=f"Described are {', '.join(names)}.",
            )  # fmt: skip
        elif bound is not None:
            return quantity(bound, unit, place)
        if symbol in names:
            actuator = self.actuators[names.index(symbol)]
            if unit and actuator.unit != unit:
                raise BadInput(f"{symbol} moves in {actuator.unit}, not in {unit}", place=place)
            return Term("actuator", names.index(symbol), 1.0)
        if symbol in self.index:
            return self.parameter_term(symbol, unit, place)
        known = [*declared, *names, *spec, *self.table("parameters")]
        near = difflib.get_close_matches(symbol, known, 1)
        raise BadInput(
            f'"{symbol}" is neither a parameter, an actuator nor a value of limb {limb}',
            place=place,
            remedy=f'Did you mean "{near[0]}"?' if near else f"Set it in [limbs.{limb}].",
        )

    def parameter_term(self, name: str, unit: str, place: str) -> Term:
        parameter = self.parameters[self.index[name]]
        if unit and parameter.unit != unit:
            raise BadInput(
                f"{name} is in {parameter.unit}, a value in {unit} is needed", place=place
            )
        return Term("parameter", self.index[name], 1.0)

    def check_names(
        self,
        name: str,
        spec: Mapping[str, Any],
        declared: Mapping[str, Any],
        used: set[str],
        unknown_joints: Mapping[str, object],
    ) -> None:
        for key in (*spec, *declared):
            if key not in used and key not in _LIMB_KEYS:
                near = difflib.get_close_matches(key, sorted(used | set(_LIMB_KEYS)), 1)
                raise self.fail(
                    f'the chain of limb "{name}" does not use "{key}"',
                    "limbs", name, key,
                    remedy=f'Did you mean "{near[0]}"?' if near else "Remove it, or use it.",
                )  # fmt: skip
        if unknown_joints:
            raise self.fail(
                f'limb "{name}" has no joint named "{next(iter(unknown_joints))}"',
                "limbs", name,
                remedy="Name joints in the chain: psi=Rx(90d).",
            )  # fmt: skip

    def check_references(self, limbs: tuple[Limb, ...]) -> None:
        driven: dict[int, list[str]] = {}
        for limb in limbs:
            for element in limb.elements:
                for term in element.terms:
                    if term.kind == "actuator":
                        driven.setdefault(term.index, []).append(limb.name)
        twice = [
            f"{self.actuators[i].name} drives {' and '.join(names)}"
            for i, names in driven.items()
            if len(names) > 1
        ]
        for i, actuator in enumerate(self.actuators):
            keys = ("actuators", actuator.name)
            if i not in driven:
                raise self.fail(
                    f"actuator {actuator.name} drives no joint"
                    + (f", while {'; '.join(twice)}" if twice else ""),
                    *keys,
                    remedy=f"Let a joint move by it: Ty:{actuator.name}, or q = "
                    f'"{actuator.name}" in the table of its limb.',
                )
            if isinstance(actuator.reference, str) and actuator.reference not in self.index:
                raise self.fail(
                    f'"{actuator.reference}" is not a parameter', *keys,
                    remedy="reference is a number or the name of a parameter (leg1.L0).",
                )  # fmt: skip

    def home(self) -> tuple[float, float, float, float, float, float]:
        self.known(self.table("home"), ("pose",), "home")
        pose = self.table("home", "pose")
        self.known(pose, POSE, "home", "pose")
        x, y, z, rx, ry, rz = (
            self.number(pose.get(k, 0.0), _unit_of(k), "home", "pose") for k in POSE
        )
        return x, y, z, rx, ry, rz

    def task(self) -> Task:
        names = self.table("task").get("coordinates", list(POSE))
        allowed = (*POSE, *_POINTING)
        if not isinstance(names, list) or not names or any(n not in allowed for n in names):
            raise self.fail(
                "coordinates must be a list of x, y, z, rx, ry, rz, or tilt and azimuth",
                "task", "coordinates",
            )  # fmt: skip
        if len(names) != len(self.actuators) or ("tilt" in names) != ("azimuth" in names):
            raise self.fail(
                f"{len(names)} task coordinates for {len(self.actuators)} actuators",
                "task", "coordinates",
                remedy="Name as many coordinates of the pose as there are actuators.",
            )  # fmt: skip
        return Task(tuple(names))

    def workspace(self) -> dict[str, tuple[float, float]]:
        box = self.table("workspace")
        self.known(box, (*POSE, *_POINTING), "workspace")
        return {k: self.pair(v, _unit_of(k), "workspace", k) for k, v in box.items()}

    def size(self, limbs: tuple[Limb, ...], home: tuple[float, ...]) -> float:
        lengths = [abs(p.nominal) for p in self.parameters if p.unit == "mm"]
        lengths += [
            abs(element.constant)
            for limb in limbs
            for element in limb.elements
            if not element.turns and not element.compliance
        ]
        return max([*lengths, float(np.linalg.norm(home[:3])), 1e-3])
