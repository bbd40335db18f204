"""The site file: what stands in this lab, at which address, and what is normal here.

The format ``pkm-site/1`` is described in docs/site-file.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from app.devices import Role, kind_named, kind_names
from app.files.machines import load_machine
from app.files.record_details import FILES, RecordDetails, record_details
from app.files.site_devices import (
    FARTHEST_MM,
    ControllerSite,
    Hands,
    TrackerSite,
    read_controller,
    read_hands,
    read_tracker,
)
from app.files.site_gauge import GaugeSite, read_gauge
from app.files.site_limits import Limits, read_limits
from app.files.text import read_text
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.runs.header import Load, load_of
from calib.runs.sensing import Setup
from calib.runs.setup import nests_of, planes_of
from calib.toml_faults import Faults
from calib.toml_table import TomlTable

FORMAT = "pkm-site/1"
FASTEST = 1e6
"""No mock's clock runs faster."""


@dataclass(frozen=True)
class Site:
    """A site file, checked."""

    source: str
    data: Mapping[str, Any]
    title: str
    machine_name: str
    machine: Machine
    controller: ControllerSite
    platform_nests: Mapping[str, tuple[float, ...]]
    base_nests: Mapping[str, tuple[float, ...]]
    load: Load | None
    payload_kg: float | None
    hands: Hands
    limits: Limits
    clock_scale: float
    tracker_there: TrackerSite | None = None
    gauge: GaugeSite | None = None
    """What measures: one of both is there."""
    setup: Setup | None = None
    """Planes, and nests that are not exact, of a site with a gauge."""
    offers: tuple[Path, ...] = ()
    """Effect files that discovery has as candidates beside the catalogue."""
    controller_parameters: Mapping[str, float] = field(default_factory=dict)
    record: RecordDetails = field(default_factory=RecordDetails)

    @property
    def tracker(self) -> TrackerSite:
        """The tracker; raises :class:`BadInput` where a gauge measures."""
        if self.tracker_there is None:
            raise BadInput(
                "this needs a tracker, and the site has a gauge",
                place=self.source,
                remedy="Name a site with a [tracker]; with a gauge there is pkmcal measure",
            )
        return self.tracker_there

    @property
    def measured_by(self) -> TrackerSite | GaugeSite:
        """What measures."""
        return self.tracker if self.gauge is None else self.gauge

    def to_toml(self) -> str:
        """Render the site as a file that stands alone, for the session's folder."""
        return tomli_w.dumps(dict(self.data))


def load_site(path: Path) -> Site:
    """Read and check a site file; raises :class:`BadInput` with file, line and remedy."""
    return parse_site(read_text(path), str(path), path.parent)


def parse_site(text: str, source: str, folder: Path) -> Site:
    """Check the text of a site file; paths in it start from ``folder``.

    Raises
    ------
    BadInput
        With every fault that can be told (:class:`calib.toml_faults.ManyFaults`).
    """
    return site_of(TomlTable.parse(text, source, all_faults=True), source, folder)


def site_of(top: TomlTable, source: str, folder: Path) -> Site:
    """Check the tables of a site file."""
    top.format(FORMAT)
    faults = top.faults or Faults(source)
    attempt = faults.attempt
    machine_name = top.text("machine")
    machine = attempt(lambda: _machine(top, machine_name, folder))
    nests, by_gauge = top.table("nests"), top.has("gauge")
    platform, base = nests.named("platform"), nests.named("base", required=not by_gauge)
    setup = None
    if by_gauge:
        platform_nests, base_nests, setup = _places(top, platform, base)
    else:
        platform_nests = {name: _centre(platform, name) for name in platform}
        base_nests = {name: _centre(base, name) for name in base}
    attempt(lambda: _check_nests(platform_nests, base_nests, base, 0 if by_gauge else 3))
    loaded = attempt(lambda: _load(top))
    title = top.text("title", "")
    # How many actuators there are is known only of a machine that can be read.
    count = len(machine.actuators) if isinstance(machine, Machine) else None
    controller = attempt(lambda: read_controller(top.table("controller"), count, folder))
    tracker = gauge = None
    if by_gauge and top.has("tracker"):
        top.complain("a tracker and a gauge", "gauge", remedy="Name the one that is to measure")
    if setup is not None:
        own, places = setup, (platform_nests, base_nests)
        gauge = attempt(lambda: read_gauge(top.table("gauge"), own.planes, places, count, folder))
    else:
        tracker = attempt(lambda: read_tracker(top.table("tracker"), count, folder))
    hands = attempt(lambda: read_hands(top.table("hands", required=False)))
    limits = attempt(lambda: read_limits(top.table("limits", required=False)))
    clock_scale = attempt(lambda: _clock(top.table("clock", required=False)))
    offers = attempt(lambda: _offers(top.table("effects", required=False), folder))
    record = attempt(lambda: record_details(top.table("record", required=False), folder))
    nests.end()
    top.end()
    faults.end()
    load, payload_kg = loaded
    return Site(
        source=source, data=_standing_alone(top, machine_name, folder), title=title,
        machine_name=machine_name, machine=machine, controller=controller,
        tracker_there=tracker, gauge=gauge, setup=setup,
        platform_nests=platform_nests, base_nests=base_nests, load=load, payload_kg=payload_kg,
        hands=hands, limits=limits, clock_scale=clock_scale, offers=offers, record=record,
    )  # fmt: skip


def _machine(top: TomlTable, name: str, folder: Path) -> Machine:
    try:
        return load_machine(name, folder)
    except BadInput as error:
        if error.place:
            raise
        raise top.wrong(error.what, "machine", remedy=error.remedy) from None


def _standing_alone(top: TomlTable, machine_name: str, folder: Path) -> dict[str, Any]:
    """The file's tables, with paths that hold from everywhere."""
    data = top.as_it_stands()
    if machine_name.endswith(".toml"):
        data["machine"] = str((folder / machine_name).resolve())
    if isinstance(offered := data.get("effects"), dict) and "offer" in offered:
        files = [str((folder / str(name)).resolve()) for name in offered["offer"]]
        data["effects"] = {**offered, "offer": files}
    if isinstance(record := data.get("record"), dict):
        data["record"] = {
            name: str((folder / text).resolve()) if name in FILES and text else text
            for name, text in record.items()
        }
    roles: tuple[Role, ...] = ("controller", "tracker", "gauge")
    for role in roles:
        if isinstance(own := data.get(role), dict) and isinstance(own.get("kind"), str):
            data[role] = {**own, **_absolute(own, role, folder)}
    return data


def _absolute(own: Mapping[str, Any], role: Role, folder: Path) -> dict[str, Any]:
    """The paths among a device's settings, whole; what is no path is refused elsewhere."""
    if own["kind"] not in kind_names(role):
        return {}
    declared = kind_named(role, own["kind"]).settings
    names = [one.name for one in declared if one.form in ("file", "files")]
    paths: dict[str, Any] = {}
    for name in ("store", *names):
        match own.get(name):
            case str(path) if path:
                paths[name] = str((folder / path).resolve())
            case [*several] if all(isinstance(path, str) for path in several):
                paths[name] = [str((folder / path).resolve()) for path in several]
    return paths


def _centre(nests: TomlTable, name: str) -> tuple[float, ...]:
    return nests.numbers(name, 3, unit="mm", most=FARTHEST_MM)


def _places(
    top: TomlTable, platform: TomlTable, base: TomlTable
) -> tuple[dict[str, tuple[float, ...]], dict[str, tuple[float, ...]], Setup]:
    """Centres of nests, exact or not, and what else version 2 of a run says."""
    found: list[dict[str, tuple[float, ...]]] = []
    spreads: dict[str, Array] = {}
    for table in (platform, base):
        centres, spread = nests_of(table)
        found.append({name: tuple(float(v) for v in at) for name, at in centres.items()})
        spreads |= spread
    return found[0], found[1], Setup(planes=planes_of(top), nests=spreads)


def _check_nests(
    platform: Mapping[str, Any], base: Mapping[str, Any], table: TomlTable, least: int
) -> None:
    if len(base) < least:
        table.complain(f"{len(base)} base nests", remedy="At least three tie tracker and base")
    if len(platform) < 1:
        raise table.wrong("no platform nest", remedy="Give at least one in [nests.platform]")
    both = set(base) & set(platform)
    if both:
        name = min(both)
        raise table.wrong(f'nest "{name}" is on both', name, remedy="Give every nest its own name")


def _clock(table: TomlTable) -> float:
    scale = table.number("scale", 1.0, above=0.0, most=FASTEST)
    table.end()
    return scale


def _offers(table: TomlTable, folder: Path) -> tuple[Path, ...]:
    """Effect files; each must be one now, not when a run has been measured."""
    files = tuple((folder / name).resolve() for name in table.texts("offer"))
    table.end()
    if files:
        from app.files.models import offered_effects  # slow to import, and most sites offer none

        offered_effects(files)
    return files


def _load(top: TomlTable) -> tuple[Load | None, float | None]:
    """What the platform weighs, and the mass of the payload where no device tells it."""
    if not top.has("load"):
        return None, None
    table = top.table("load")
    load, payload_kg = load_of(table), table.optional_number("payload_kg", unit="kg")
    if payload_kg is not None and payload_kg < 0.0:
        table.complain(f"payload_kg is {payload_kg}", "payload_kg", remedy="Give its mass, kg")
    table.end()
    return load, payload_kg


def site_of_mock(announcement: Mapping[str, Any]) -> Site:
    """Make the site of a mock station from the line that it prints (its ``site`` table)."""
    if "site" not in announcement:
        raise BadInput("the mock station's line has no site", remedy="Start it with --json")
    text = tomli_w.dumps({"format": FORMAT, **announcement["site"]})
    return parse_site(text, "mock station", Path())
