"""Machine file (TOML text) -> :class:`Machine`. Every fault is named with its line and remedy."""

import numpy as np

from calib.mechanism.description import (
    Actuator,
    Limb,
    Machine,
    Task,
)
from calib.mechanism.hidden import with_hidden_apart
from calib.mechanism.limbs import LimbReader, unit_of
from calib.mechanism.traits_by_name import traits_by_name
from calib.toml_faults import Faults
from calib.toml_table import TomlTable

FORMAT = "pkm-machine/1"
POSE = ("x", "y", "z", "rx", "ry", "rz")
_POINTING = ("tilt", "azimuth")
_TOP = (
    "format", "name", "says", "source", "home", "task", "workspace", "parameters", "actuators",
    "limb_types", "limbs", "effects", "drawing", "closure", "nests",
)  # fmt: skip
_KEPT = ("effects", "drawing", "closure", "nests")
"""Tables for the parts of the program that ask for them."""
_ACTUATOR_KEYS = ("unit", "reference", "home", "limits", "gear", "says")


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
        Naming the file, the line, what was found and the remedy; with several faults that can be
        told apart each of them (:class:`calib.toml_faults.ManyFaults`).
    """
    return _Reader(TomlTable.parse(text, source), Faults(source)).machine(source)


def _unit_of(name: str) -> str:
    return "mm" if name in ("x", "y", "z") else "rad"


class _Reader(LimbReader):
    def machine(self, source: str) -> Machine:
        top = self.top
        attempt = self.faults.attempt
        top.format(FORMAT)
        name = attempt(self.name)
        actuators = top.named("actuators", required=False)
        for key in actuators:
            self.add_actuator(key, actuators.table(key))
        if not self.actuators:
            raise top.wrong("no actuator is described", remedy="Add a table [actuators].")
        parameters = top.named("parameters", required=False)
        for key in parameters:
            self.add_parameter(key, parameters.table(key), parameters.table(key), "nominal")
        limb_tables = top.named("limbs", required=False)
        if not limb_tables.names():
            raise top.wrong("no limb is described", remedy="Add tables [limbs.NAME].")
        found: list[Limb] = []
        for key in limb_tables:
            found += self.attempted_limb(key, limb_tables.table(key))
        home, task, workspace = attempt(self.home), attempt(self.task), attempt(self.workspace)
        self.faults.end()
        limbs = tuple(found)
        self.check_references(limbs)
        if not self.traits_stated:
            limbs = traits_by_name(limbs, self.chain_names, self.parameters, self.actuators)
        machine = Machine(
            name=name,
            says=top.text("says", ""),
            source=source,
            limbs=limbs,
            parameters=tuple(self.parameters),
            actuators=tuple(self.actuators),
            task=task,
            home=home,
            workspace=workspace,
            size=self.size(limbs, home),
            extra={key: top.raw(key) for key in _KEPT if top.has(key)},
            traits_stated=self.traits_stated,
        )
        return with_hidden_apart(machine)

    def name(self) -> str:
        self.top.only(*_TOP)  # a key that is misspelt may be the name
        name = self.top.text("name", "")
        if not name:
            raise self.top.wrong("the machine has no name", remedy='Write name = "my-machine".')
        return name

    def add_actuator(self, name: str, table: TomlTable) -> None:
        """Add an actuator; one that cannot be read stands there all the same, known by name."""
        read = self.faults.attempt(lambda: _actuator(name, table))
        unit = "rad" if table.raw("unit") == "rad" else "mm"
        self.actuators.append(read or Actuator(name, unit, 0.0, (-1.0, 1.0), 0.0, 0.0))

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
            table = self.top.named("actuators")
            if i not in driven:
                raise table.wrong(
                    f"actuator {actuator.name} drives no joint"
                    + (f", while {'; '.join(twice)}" if twice else ""),
                    actuator.name,
                    remedy=f"Let a joint move by it: Ty:{actuator.name}, or q = "
                    f'"{actuator.name}" in the table of its limb.',
                )
            if isinstance(actuator.reference, str) and actuator.reference not in self.index:
                raise table.wrong(
                    f'"{actuator.reference}" is not a parameter',
                    actuator.name,
                    remedy="reference is a number or the name of a parameter (leg1.L0).",
                )

    def home(self) -> tuple[float, float, float, float, float, float]:
        home = self.top.table("home", required=False)
        home.only("pose")
        pose = home.table("pose", required=False)
        pose.only(*POSE)
        x, y, z, rx, ry, rz = (pose.quantity(name, _unit_of(name), 0.0) for name in POSE)
        return x, y, z, rx, ry, rz

    def task(self) -> Task:
        task = self.top.table("task", required=False)
        names = task.texts("coordinates") if task.has("coordinates") else list(POSE)
        allowed = (*POSE, *_POINTING)
        if not names or any(name not in allowed for name in names):
            raise task.wrong(
                "coordinates are a list of x, y, z, rx, ry, rz, or tilt and azimuth",
                "coordinates",
                remedy='Write coordinates = ["x", "y", "z"], say',
            )
        if len(names) > len(self.actuators) or ("tilt" in names) != ("azimuth" in names):
            raise task.wrong(
                f"{len(names)} task coordinates for {len(self.actuators)} actuators",
                "coordinates",
                remedy="Name as many coordinates of the pose as there are actuators, or fewer; "
                "tilt and azimuth go together.",
            )
        return Task(tuple(names))

    def workspace(self) -> dict[str, tuple[float, float]]:
        box = self.top.table("workspace", required=False)
        box.only(*POSE, *_POINTING)
        return {name: box.limits(name, _unit_of(name)) for name in box}

    def size(self, limbs: tuple[Limb, ...], home: tuple[float, ...]) -> float:
        lengths = [abs(p.nominal) for p in self.parameters if p.unit == "mm"]
        lengths += [
            abs(element.constant)
            for limb in limbs
            for element in limb.elements
            if not element.turns and not element.compliance
        ]
        return max([*lengths, float(np.linalg.norm(home[:3])), 1e-3])


def _actuator(name: str, table: TomlTable) -> Actuator:
    table.only(*_ACTUATOR_KEYS)
    unit = unit_of(table, "An actuator is in mm or rad.")
    reference = table.raw("reference")
    is_name = (
        isinstance(reference, str) and not reference[:1].isdigit() and reference[:1] not in "+-."
    )
    limits, home = table.limits("limits", unit), table.quantity("home", unit)
    if not limits[0] <= home <= limits[1]:
        raise table.wrong(
            f"home {home:g} of {name} is outside its limits {limits[0]:g}..{limits[1]:g}",
            "home",
            remedy="Write a home within them, or wider limits",
        )
    table.text("says", "")
    gear = table.optional_number("gear", above=0.0)
    if gear is not None and unit != "rad":
        raise table.wrong(
            f"{name} is in mm: a gear stands before a joint that turns",
            "gear",
            remedy="Leave it out; the pitch of a screw is [effects.screw-cyclic] period.",
        )
    return Actuator(
        name,
        unit,
        home,
        limits,
        reference if is_name else table.quantity("reference", unit, 0.0),
        gear or 0.0,
    )
