"""Limbs of a machine file: chains, their parameters and the values that each limb binds."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calib.errors import BadInput
from calib.mechanism.chain import ChainNames, ChainReader
from calib.mechanism.chain_value import Meant
from calib.mechanism.description import Actuator, Limb, Parameter, Term
from calib.mechanism.trait_reader import TraitReader
from calib.quantity import measured
from calib.toml_faults import Faults
from calib.toml_table import TomlTable

_TYPE_KEYS = ("chain", "chains", "parameters", "joints", "traits", "says")
_PARAMETER_KEYS = ("unit", "tolerance", "sigma", "nominal", "says", "hidden")
_LIMB_KEYS = ("type", "chain", "chains", "parameters", "joints", "traits", "says")


@dataclass
class LimbReader:
    """Reads limbs one after the other, and the parameters that they declare."""

    top: TomlTable
    """The whole machine file."""
    faults: Faults
    """What is wrong with it; what can be read behind a fault is read."""
    parameters: list[Parameter] = field(default_factory=list)
    index: dict[str, int] = field(default_factory=dict)
    actuators: list[Actuator] = field(default_factory=list)
    joints: int = 0
    chain_names: list[ChainNames] = field(default_factory=list)
    """Names in the chain of every limb."""
    traits_stated: bool = False
    told: set[tuple[str, str]] = field(default_factory=set)
    """Faults of limbs that were told: where, and what but for the limb's name."""

    def add_parameter(self, name: str, about: TomlTable, at: TomlTable, key: str) -> None:
        """Add a parameter that ``about`` describes; its nominal value is ``key`` of ``at``.

        One that cannot be read stands there all the same: what names it is no fault.
        """
        unit = "rad" if about.raw("unit") == "rad" else "mm"
        stands_in = Parameter(name, 0.0, unit, 1.0, 1.0, "", False)
        read = self.faults.attempt(lambda: self._parameter_of(name, about, at, key)) or stands_in
        self.index.setdefault(name, len(self.parameters))
        self.parameters.append(read)

    def _parameter_of(self, name: str, about: TomlTable, at: TomlTable, key: str) -> Parameter:
        about.only(*_PARAMETER_KEYS)
        unit = unit_of(about, "A parameter is in mm or rad.")
        if not at.has(key):
            raise about.wrong(
                f'parameter "{name}" has no nominal value', remedy="Set it in the limb's table."
            )
        nominal = at.quantity(key, unit)
        tolerance = about.quantity("tolerance", unit, 0.0)
        sigma = about.quantity("sigma", unit, tolerance / float(np.sqrt(3.0)))
        if sigma <= 0.0 or tolerance < 0.0:
            raise about.wrong(
                f'parameter "{name}" has no positive tolerance',
                remedy="Give tolerance (uniform half-width) or sigma; a fixed value is a constant.",
            )
        if name in self.index:
            raise about.wrong(f'parameter "{name}" is described twice', remedy="Keep one of them.")
        return Parameter(
            name,
            nominal,
            unit,
            tolerance or float(sigma * np.sqrt(3.0)),
            sigma,
            about.text("says", ""),
            about.flag("hidden", False),
        )

    def attempted_limb(self, name: str, own: TomlTable) -> list[Limb]:
        """A limb as :meth:`limb` reads it; none where it cannot be read.

        A fault of a type's chain is told once, not for each limb of the type.
        """
        try:
            return self.limb(name, own)
        except BadInput as fault:
            where, what = fault.place.split(", limb ")[0], fault.what.replace(name, "")
            if (where, what) not in self.told:
                self.told.add((where, what))
                self.faults.add(fault)
            return []

    def limb(self, name: str, own: TomlTable) -> list[Limb]:
        """A limb, or the several that go by one name (the rods of a parallelogram)."""
        kind = self._kind(own)
        chains, chain_place = self._chains(name, own, kind)
        declared: dict[str, TomlTable] = {}
        for table in (kind, own):
            described = table.named("parameters", required=False)
            declared |= {key: described.table(key) for key in described}
        for key, about in declared.items():
            at, under = (own, key) if own.has(key) else (about, "nominal")
            self.add_parameter(f"{name}.{key}", about, at, under)
        used: set[str] = set()
        limits = _joint_limits(kind) | _joint_limits(own)
        limbs, unknown = [], dict(limits)
        for chain in chains:
            reader = ChainReader(
                lambda symbol, place: self._resolve(name, own, declared, used, symbol, place),
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
        _check_names(name, own, declared, used, unknown)
        return self._with_traits(name, own if own.has("traits") else kind, limbs)

    def _kind(self, own: TomlTable) -> TomlTable:
        """The limb's type; an empty table where it has none."""
        name = own.text("type", "")
        types = self.top.named("limb_types", required=False)
        if name and not types.has(name):
            raise own.wrong(
                f'limb type "{name}" is not described',
                "type",
                remedy=f"Known: {', '.join(types)}.",
            )
        kind = types.table(name, required=False)
        kind.only(*_TYPE_KEYS)
        return kind

    def _with_traits(self, name: str, table: TomlTable, limbs: list[Limb]) -> list[Limb]:
        """The chains of a limb with its own traits, or else those of its type."""
        if not table.has("traits"):
            return limbs
        self.traits_stated = True
        names, nominal = self.chain_names[-len(limbs) :], [p.nominal for p in self.parameters]
        return TraitReader(table.table("traits"), name, limbs, names, nominal).read()

    def _chains(self, name: str, own: TomlTable, kind: TomlTable) -> tuple[list[str], str]:
        """The chains of a limb and where they stand."""
        table = own if own.has("chain") or own.has("chains") else kind
        if table.has("chains"):
            if chains := table.texts("chains"):
                return chains, table.place("chains")
            raise table.wrong("chains is an empty list", "chains", remedy='Write ["tx:...", ...].')
        chain = table.text("chain", "")
        if not chain:
            raise own.wrong(f'limb "{name}" has no chain', remedy='Write chain = "tx:... Rx ...".')
        return [chain], table.place("chain")

    def _resolve(
        self,
        limb: str,
        own: TomlTable,
        declared: Mapping[str, object],
        used: set[str],
        symbol: str,
        place: str,
    ) -> Meant:
        names = [a.name for a in self.actuators]
        used.add(symbol)
        if symbol in declared:
            return self._parameter(f"{limb}.{symbol}")
        bound = own.raw(symbol)
        if isinstance(bound, str) and (bound in names or bound in self.index):
            symbol = bound
        elif isinstance(bound, str) and bound.isidentifier():
            raise own.wrong(
                f'"{bound}" is no actuator of this machine',
                symbol,
                remedy=f"Described are {', '.join(names)}.",
            )
        elif bound is not None:
            return Meant(*measured(bound, place))
        if symbol in names:
            actuator = self.actuators[names.index(symbol)]
            return Meant(Term("actuator", names.index(symbol), 1.0), actuator.unit)
        if symbol in self.index:
            return self._parameter(symbol)
        known = [*declared, *names, *own, *self.top.named("parameters", required=False)]
        near = difflib.get_close_matches(symbol, known, 1)
        raise BadInput(
            f'"{symbol}" is neither a parameter, an actuator nor a value of limb {limb}',
            place=place,
            remedy=f'Did you mean "{near[0]}"?' if near else f"Set it in [limbs.{limb}].",
        )

    def _parameter(self, name: str) -> Meant:
        index = self.index[name]
        return Meant(Term("parameter", index, 1.0), self.parameters[index].unit)


def unit_of(table: TomlTable, remedy: str) -> str:
    """The unit that a table states, mm or rad."""
    unit = table.text("unit", "")
    if unit not in ("mm", "rad"):
        raise table.wrong(f'unknown unit "{unit}"', "unit", remedy=remedy)
    return unit


def _joint_limits(table: TomlTable) -> dict[str, tuple[float, float]]:
    limits = {}
    joints = table.named("joints", required=False)
    for joint in joints:
        about = joints.table(joint)
        about.only("limits", "says")
        limits[joint] = about.limits("limits", "")
    return limits


def _check_names(
    name: str,
    own: TomlTable,
    declared: Mapping[str, object],
    used: set[str],
    unknown_joints: Mapping[str, object],
) -> None:
    for key in (*own, *declared):
        if key not in used and key not in _LIMB_KEYS:
            near = difflib.get_close_matches(key, sorted(used | set(_LIMB_KEYS)), 1)
            raise own.wrong(
                f'the chain of limb "{name}" does not use "{key}"',
                key,
                remedy=f'Did you mean "{near[0]}"?' if near else "Remove it, or use it.",
            )
    if unknown_joints:
        raise own.wrong(
            f'limb "{name}" has no joint named "{next(iter(unknown_joints))}"',
            "joints",
            remedy="Name joints in the chain: psi=Rx(90d).",
        )
