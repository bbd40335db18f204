"""``[controller]``, ``[tracker]``, ``[hands]`` of a site file: who moves, measures, carries."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.devices import kind_named, kind_names
from app.files.device_settings import read_address, read_settings
from calib.toml_table import TomlTable
from drivers.kind import Takes

FARTHEST_MM = 1e9


@dataclass(frozen=True)
class ControllerSite:
    """Which motion controller it is; ``settings`` holds what its kind declares.

    ``address`` names this very one: its channel or port. ``takes`` says what it is commanded
    with (:class:`drivers.kind.Kind`). ``store`` is the folder of the host's
    parameter sets where the host computes the motion; empty: the usual one.
    """

    kind: str
    serial: str
    settings: Mapping[str, Any]
    address: str
    takes: Takes = "parameters"
    store: str = ""

    @property
    def hosted(self) -> bool:
        """Whether the host computes the motion, with parameters of its own."""
        return self.takes != "parameters"


@dataclass(frozen=True)
class TrackerSite:
    """Which tracker it is, and roughly how it stands; ``settings`` are those of its kind.

    ``frame`` is the base frame in the tracker frame (x, y, z mm; rx, ry, rz rad) and
    ``frame_radius_mm`` how wrong a point computed with it may be.
    """

    kind: str
    serial: str
    settings: Mapping[str, Any]
    address: str
    model: str
    reflector: str
    frame: tuple[float, ...]
    frame_radius_mm: float


@dataclass(frozen=True)
class Hands:
    """Who carries SMRs, and how many there are.

    ``base_smrs``: the reference nests on the base hold SMRs of their own that stay.
    """

    kind: str
    host: str
    port: int
    smrs: int
    base_smrs: bool


def read_controller(table: TomlTable, actuators: int | None, folder: Path) -> ControllerSite:
    """Check ``[controller]``; raises BadInput with line and remedy."""
    name = table.choice("kind", kind_names("controller"))
    kind = kind_named("controller", name)
    settings = read_settings(table, kind, actuators, folder)
    serial = table.text("serial", "")
    address = kind.address(settings)
    site = ControllerSite(name, serial, settings, address, kind.takes)
    if store := table.text("store", ""):
        if not site.hosted:
            table.complain(
                f"a controller of the kind {name} keeps its parameters itself",
                "store",
                remedy="Leave store out",
            )
        site = replace(site, store=str((folder / store).resolve()))
    table.end()
    return site


def read_tracker(table: TomlTable, actuators: int | None, folder: Path) -> TrackerSite:
    """Check ``[tracker]``; raises BadInput with line and remedy."""
    name = table.choice("kind", kind_names("tracker"))
    kind = kind_named("tracker", name)
    settings = read_settings(table, kind, actuators, folder)
    site = TrackerSite(
        kind=name,
        serial=table.text("serial", ""),
        settings=settings,
        address=kind.address(settings),
        model=table.text("model", "AT901-LR" if name == "emscon" else name),
        reflector=table.text("reflector", ""),
        frame=table.numbers("frame", 6, unit="mm, rad", most=FARTHEST_MM),
        frame_radius_mm=table.number("frame_radius_mm", 20.0, unit="mm", above=0.0, most=math.inf),
    )
    table.end()
    return site


def read_hands(table: TomlTable) -> Hands:
    """Check ``[hands]``; raises BadInput with line and remedy."""
    kind = table.choice("kind", ["operator", "mock"], "operator")
    host, port = read_address(table, "control", 0) if kind == "mock" else ("", 0)
    hands = Hands(kind, host, port, table.whole("smrs", 1, least=1), table.flag("base_smrs", True))
    table.end()
    return hands
