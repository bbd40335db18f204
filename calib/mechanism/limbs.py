"""Limbs of a machine file: chains, their parameters and the values that each limb binds."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calib.errors import BadInput
from calib.mechanism.chain import ChainNames, ChainReader
from calib.mechanism.chain_value import Meant
from calib.mechanism.description import Actuator, Limb, Parameter, Term
from calib.mechanism.tables import TableReader
from calib.mechanism.trait_reader import TraitReader
from calib.quantity import measured

_TYPE_KEYS = ("chain", "chains", "parameters", "joints", "traits", "says")
_PARAMETER_KEYS = ("unit", "tolerance", "sigma", "nominal", "says", "hidden")
_LIMB_KEYS = ("type", "chain", "chains", "parameters", "joints", "traits", "says")


@dataclass
class LimbReader(TableReader):
    """Reads limbs one after the other, and the parameters that they declare."""

    parameters: list[Parameter] = field(default_factory=list)
    index: dict[str, int] = field(default_factory=dict)
    actuators: list[Actuator] = field(default_factory=list)
    joints: int = 0
    chain_names: list[ChainNames] = field(default_factory=list)
    """Names in the chain of every limb."""
    traits_stated: bool = False

    def add_parameter(
        self, name: str, spec: Any, keys: tuple[str, ...], bound: object | None
    ) -> None:
        """Add a parameter with the nominal value that a limb binds to it, or its own."""
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
        chains, chain_place = self._chains(name, spec, kind_name, kind)
        declared = {**kind.get("parameters", {}), **spec.get("parameters", {})}
        for key, description in declared.items():
            place = (*keys, key) if key in spec else ("limb_types", kind_name, "parameters", key)
            self.add_parameter(f"{name}.{key}", description, place, spec.get(key))
        used: set[str] = set()
        limits = self._joint_limits(kind_name, kind, spec, keys)
        limbs, unknown = [], dict(limits)
        for chain in chains:
            reader = ChainReader(
                lambda symbol, place: self._resolve(name, spec, declared, used, symbol, place),
                f"{chain_place}, limb {name}",
                self.joints,
                dict(limits),
            )
            reader.read(chain)
            unknown = {joint: v for joint, v in unknown.items() if joint in reader.limits}
            self.joints += len(reader.joints)
            first = self.joints - len(reader.joints)
            limbs.append(Limb(name, tuple(reader.elements), tuple(reader.joints), first))
            self.chain_names.append(reader.names)
        self._check_names(name, spec, declared, used, unknown)
        return self._with_traits(name, spec, kind_name, kind, limbs)

    def _with_traits(
        self,
        name: str,
        spec: Mapping[str, Any],
        kind_name: str,
        kind: Mapping[str, Any],
        limbs: list[Limb],
    ) -> list[Limb]:
        """The chains of a limb with its own traits, or else those of its type."""
        own = "traits" in spec
        keys = ("limbs", name, "traits") if own else ("limb_types", kind_name, "traits")
        stated = (spec if own else kind).get("traits")
        if stated is None:
            return limbs
        self.traits_stated = True
        names, nominal = self.chain_names[-len(limbs) :], [p.nominal for p in self.parameters]
        return TraitReader(self, name, limbs, names, nominal, keys).read(self.table(*keys))

    def _chains(
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

    def _joint_limits(
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

    def _resolve(
        self,
        limb: str,
        spec: Mapping[str, Any],
        declared: Mapping[str, Any],
        used: set[str],
        symbol: str,
        place: str,
    ) -> Meant:
        names = [a.name for a in self.actuators]
        used.add(symbol)
        if symbol in declared:
            return self._parameter(f"{limb}.{symbol}")
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
            return Meant(*measured(bound, place))
        if symbol in names:
            actuator = self.actuators[names.index(symbol)]
            return Meant(Term("actuator", names.index(symbol), 1.0), actuator.unit)
        if symbol in self.index:
            return self._parameter(symbol)
        known = [*declared, *names, *spec, *self.table("parameters")]
        near = difflib.get_close_matches(symbol, known, 1)
        raise BadInput(
            f'"{symbol}" is neither a parameter, an actuator nor a value of limb {limb}',
            place=place,
            remedy=f'Did you mean "{near[0]}"?' if near else f"Set it in [limbs.{limb}].",
        )

    def _parameter(self, name: str) -> Meant:
        index = self.index[name]
        return Meant(Term("parameter", index, 1.0), self.parameters[index].unit)

    def _check_names(
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
