"""Machine file (TOML text) -> :class:`Machine`. Every fault is named with its line and remedy."""

from typing import Any

import numpy as np

from calib.mechanism.description import (
    Actuator,
    Limb,
    Machine,
    Task,
)
from calib.mechanism.hidden import with_hidden_apart
from calib.mechanism.limbs import LimbReader
from calib.mechanism.traits_by_name import traits_by_name
from calib.toml_place import load_toml

FORMAT = "pkm-machine/1"
POSE = ("x", "y", "z", "rx", "ry", "rz")
_POINTING = ("tilt", "azimuth")
_TOP = (
    "format", "name", "says", "source", "home", "task", "workspace", "parameters", "actuators",
    "limb_types", "limbs", "effects", "drawing", "closure", "nests",
)  # fmt: skip
_ACTUATOR_KEYS = ("unit", "reference", "home", "limits", "says")


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


class _Reader(LimbReader):
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
        if not self.traits_stated:
            limbs = traits_by_name(limbs, self.chain_names, self.parameters, self.actuators)
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
            traits_stated=self.traits_stated,
        )
        return with_hidden_apart(machine)

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
