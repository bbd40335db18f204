"""The site file: what stands in this lab, at which address, and what is normal here.

::

    format = "pkm-site/1"
    machine = "hexapod"               # a shipped machine, or the path of a machine file

    [controller]
    kind = "canopen"
    interface = "slcan"               # any python-can interface
    channel = "socket://127.0.0.1:40001"
    node = 10                         # the controller's node; the drives are 1, 2, ...
    serial = "..."                    # optional; refused at connect if another one answers

    [controller]                      # or one that speaks GCS 2.0
    kind = "gcs"
    port = "COM3"                     # "/dev/ttyUSB0", "socket://192.168.0.5:50000"
    baudrate = 115200
    axes = "A B C"                    # what it calls the actuators, in their order
    pose_axes = "X Y Z"               # and the coordinates of the platform

    [tracker]
    kind = "emscon"
    address = "192.168.0.1:700"
    reflector = "CCR-1.5in"           # as the tracker calls it
    frame = [-900.0, -900.0, -400.0, 0.0, 0.0, 0.3]  # base frame in the tracker frame, roughly

    [nests.platform]                  # SMR centres, platform frame, mm
    "3" = [0.0, 100.0, 0.0]
    [nests.base]                      # SMR centres, base frame, mm
    b1 = [260.0, 0.0, -30.0]

    [hands]
    kind = "operator"                 # who carries SMRs: a person, or the mock's control socket
    smrs = 1                          # how many SMRs there are for the platform
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from app.files.machines import load_machine, read_text
from app.files.toml_reader import TableReader
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.toml_place import load_toml

FORMAT = "pkm-site/1"


@dataclass(frozen=True)
class ControllerSite:
    """Where the motion controller is; ``settings`` holds what only its kind of link needs."""

    kind: str
    serial: str
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class TrackerSite:
    """Where the tracker is, and roughly how it stands.

    ``frame`` is the base frame in the tracker frame (x, y, z mm; rx, ry, rz rad) and
    ``frame_radius_mm`` how wrong a point computed with it may be.
    """

    kind: str
    host: str
    port: int
    serial: str
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


@dataclass(frozen=True)
class Limits:
    """What is normal here: mm, s, deg C; every one has a default."""

    hole_radius_mm: float = 4.0
    """How far from its predicted place an SMR may be seen; nests are much farther apart."""
    settle_std_mm: float = 0.020
    """Scatter in the settling window below which the machine stands (tracker noise included)."""
    settle_creep_mm: float = 0.008
    """Largest difference between the means of the window's halves."""
    settle_window_s: float = 0.5
    settle_timeout_s: float = 30.0
    dwell_s: float = 3.0
    drift_mm: float = 0.050
    """Largest shift of the base against the first reference."""
    base_fit_mm: float = 0.050
    """Largest RMS of the base nests against their drawing."""
    two_face_mm: float = 0.100
    air_temp_C: tuple[float, ...] = (10.0, 35.0)
    warm_up_s: float = 60.0
    """How long the channels are watched before the run."""
    warm_up_K_per_min: float = 0.2
    move_timeout_s: float = 120.0
    """Machine seconds that a move may take."""


@dataclass(frozen=True)
class Site:
    """A site file, checked."""

    source: str
    data: Mapping[str, Any]
    title: str
    machine_name: str
    machine: Machine
    controller: ControllerSite
    tracker: TrackerSite
    platform_nests: Mapping[str, tuple[float, ...]]
    base_nests: Mapping[str, tuple[float, ...]]
    load: Mapping[str, Any]
    hands: Hands
    limits: Limits
    clock_scale: float
    controller_parameters: Mapping[str, float] = field(default_factory=dict)

    def to_toml(self) -> str:
        """Render the site as a file that stands alone, for the session's folder."""
        return tomli_w.dumps(dict(self.data))


def load_site(path: Path) -> Site:
    """Read and check a site file; raises :class:`BadInput` with file, line and remedy."""
    return parse_site(read_text(path), str(path), path.parent)


def parse_site(text: str, source: str, folder: Path) -> Site:
    """Check the text of a site file; paths in it start from ``folder``."""
    data = load_toml(text, source)
    top = TableReader(data, text, source)
    top.choice("format", [FORMAT])
    machine_name = top.text("machine")
    machine = load_machine(machine_name, folder)
    if machine_name.endswith(".toml"):
        data["machine"] = str((folder / machine_name).resolve())
    nests = top.table("nests")
    platform, base = nests.table("platform"), nests.table("base")
    site = Site(
        source=source,
        data=data,
        title=top.text("title", ""),
        machine_name=machine_name,
        machine=machine,
        controller=_controller(top.table("controller"), len(machine.actuators)),
        tracker=_tracker(top.table("tracker")),
        platform_nests={name: platform.vector(name, 3) for name in platform.keys()},  # noqa: SIM118
        base_nests={name: base.vector(name, 3) for name in base.keys()},  # noqa: SIM118
        load=_load(top.table("load", required=False)),
        hands=_hands(top.table("hands", required=False)),
        limits=_limits(top.table("limits", required=False)),
        clock_scale=_clock(top.table("clock", required=False)),
    )
    nests.end()
    top.end()
    _check_nests(site, base)
    return site


def _check_nests(site: Site, base: TableReader) -> None:
    if len(site.base_nests) < 3:
        raise base.wrong(
            "", f"{len(site.base_nests)} base nests", "At least three tie tracker and base"
        )
    if len(site.platform_nests) < 1:
        raise base.wrong("", "no platform nest", "Give at least one in [nests.platform]")
    both = set(site.base_nests) & set(site.platform_nests)
    if both:
        name = min(both)
        raise base.wrong(name, f'nest "{name}" is on both', "Give every nest its own name")


def _controller(table: TableReader, actuators: int) -> ControllerSite:
    kind = table.choice("kind", ["canopen", "gcs"])
    serial = table.text("serial", "")
    settings = _gcs(table, actuators) if kind == "gcs" else _canopen(table)
    table.end()
    return ControllerSite(kind, serial, settings)


def _canopen(table: TableReader) -> dict[str, Any]:
    return {
        "interface": table.text("interface", "slcan"),
        "channel": table.text("channel"),
        "bitrate": table.whole("bitrate", 0),
        "controller_node": table.whole("node", 10, least=1),
    }


def _gcs(table: TableReader, actuators: int) -> dict[str, Any]:
    axes = table.text("axes", "A B C").split()
    if len(axes) != actuators:
        raise table.wrong(
            "axes", f"{len(axes)} axes, {actuators} actuators", "Name one axis an actuator"
        )
    return {
        "channel": table.text("port"),
        "baudrate": table.whole("baudrate", 115200, least=300),
        "axes": axes,
        "pose_axes": table.text("pose_axes", "X Y Z").split(),
        "level_password": table.text("level_password", "advanced"),
        "store_password": table.text("store_password", "100"),
    }


def _tracker(table: TableReader) -> TrackerSite:
    host, port = _address(table, "address", 700)
    site = TrackerSite(
        kind=table.choice("kind", ["emscon"]),
        host=host,
        port=port,
        serial=table.text("serial", ""),
        model=table.text("model", "AT901-LR"),
        reflector=table.text("reflector", ""),
        frame=table.vector("frame", 6),
        frame_radius_mm=table.number("frame_radius_mm", 20.0, above=0.0),
    )
    table.end()
    return site


def _hands(table: TableReader) -> Hands:
    kind = table.choice("kind", ["operator", "mock"], "operator")
    host, port = _address(table, "control", 0) if kind == "mock" else ("", 0)
    hands = Hands(kind, host, port, table.whole("smrs", 1, least=1), table.flag("base_smrs", True))
    table.end()
    return hands


def _limits(table: TableReader) -> Limits:
    known = Limits()
    values: dict[str, Any] = {}
    for name in Limits.__dataclass_fields__:
        default = getattr(known, name)
        if isinstance(default, tuple):
            values[name] = table.vector(name, len(default), default)
        else:
            values[name] = table.number(name, default, least=0.0)
    table.end()
    return Limits(**values)


def _clock(table: TableReader) -> float:
    scale = table.number("scale", 1.0, above=0.0)
    table.end()
    return scale


def _load(table: TableReader) -> dict[str, Any]:
    load: dict[str, Any] = {}
    for name in ("gravity", "platform_com", "payload_com"):
        if table.has(name):
            load[name] = list(table.vector(name, 3))
    if table.has("platform_mass_kg"):
        load["platform_mass_kg"] = table.number("platform_mass_kg", least=0.0)
    table.end()
    return load


def _address(table: TableReader, key: str, default_port: int) -> tuple[str, int]:
    text = table.text(key)
    host, colon, port = text.rpartition(":")
    if not colon and default_port:
        return text, default_port
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise table.wrong(key, f'"{key}" is "{text}"', 'Write "host:port"')
    return host, int(port)


def site_of_mock(announcement: Mapping[str, Any]) -> Site:
    """Make the site of a mock station from the line that it prints (its ``site`` table)."""
    if "site" not in announcement:
        raise BadInput("the mock station's line has no site", remedy="Start it with --json")
    text = tomli_w.dumps({"format": FORMAT, **announcement["site"]})
    return parse_site(text, "mock station", Path())
