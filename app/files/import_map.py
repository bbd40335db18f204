"""Maps: how the tables of an instrument or a program become a run (``pkm-import/1``).

A map is a ``run.toml`` with another ``format``, in which the tables of this file say where each
column of ``points.csv`` comes from. Described in docs/import.md.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from app.files.foreign_layout import Layout, layout_of
from app.files.foreign_table import Column
from app.files.import_columns import Numbers, Text, columns_of, numbers_of, text_of
from app.files.import_sigma import NUMBERS, Sigma, sigma_of
from app.files.time_forms import FORMS
from calib.runs.header import Header, contents_of
from calib.runs.sensing import Setup
from calib.runs.setup import setup_of
from calib.toml_table import TomlTable
from calib.units import Unit, unit_named

FORMAT = "pkm-import/1"
"""What times may be, besides a pattern of strptime."""
TABLES = (
    "format", "machine", "title", "tracker", "nests", "controller", "load", "file", "time", "pose",
    "nest", "instruments", "planes", "station", "only", "actuators", "commanded_pose", "reading",
    "sigma", "channels", "commands",
)  # fmt: skip
"""What a map may hold: what a run.toml has, and where the columns come from."""
KINDS = ("xyz", "spherical", "angles", "pose", *NUMBERS)
VERTICAL = ("elevation", "zenith")
HORIZONTAL = ("counter-clockwise", "clockwise")
ROTATIONS = ("quaternion wxyz", "quaternion xyzw", "rotation vector")


@dataclass(frozen=True)
class Commanded:
    """Where the numbers of a pose stand, commanded or measured, and what its rotation is."""

    place_numbers: Numbers
    turn_numbers: Numbers
    rotation: str
    place: str


@dataclass(frozen=True)
class Reading:
    """Where one reading of a row stands; ``nest`` "" where a column names it."""

    kind: str
    numbers: Numbers
    nest: str = ""
    distance_mm: float | None = None
    vertical: str = "elevation"
    horizontal: str = "counter-clockwise"
    instrument: str = ""
    pose: Commanded | None = None
    """Of a measured pose: where its numbers stand."""
    nest2: str = ""
    """The other end of a distance."""
    plane: str = ""
    """What a direction touches."""
    value: float | None = None
    """The same number in every row (mm, rad), where no column has it: a probe that triggers."""


@dataclass(frozen=True)
class Channel:
    """A channel: a column, or one value for the whole run."""

    numbers: Numbers | None
    value: float = 0.0


@dataclass(frozen=True)
class Time:
    """Where the time of a row stands; without columns rows are ``step_s`` apart."""

    columns: tuple[Column, ...]
    form: str = "s"
    unit: Unit | None = None
    step_s: float = 0.0
    place: str = ""
    sort: bool = False


@dataclass(frozen=True)
class Commands:
    """A second table: what was commanded, by the label of the pose."""

    layout: Layout
    pose: Text


@dataclass(frozen=True)
class ImportMap:
    """A map as read; ``machine`` "" and ``header`` None where it names no machine and no nests.

    ``setup`` is what it says of instruments and planes, None if nothing.
    """

    source: str
    layout: Layout
    machine: str
    header: Header | None
    setup: Setup | None
    time: Time
    pose: Text
    nest: Text | None
    station: Text | None
    only: Text | None
    actuators: Numbers | None
    commanded: Commanded | None
    readings: tuple[Reading, ...]
    sigma: Sigma
    channels: Mapping[str, Channel]
    commands: Commands | None

    @property
    def of_kinds(self) -> bool:
        """Whether there are readings that version 1 of a run does not know."""
        return any(reading.kind not in ("xyz", "spherical") for reading in self.readings)


def parse_map(text: str, source: str) -> ImportMap:
    """Read a map.

    Raises
    ------
    BadInput
        With file, line and key.
    """
    return map_of(TomlTable.parse(text, source), source)


def map_of(top: TomlTable, source: str) -> ImportMap:
    """Read the tables of a map, see :func:`parse_map`."""
    top.format(FORMAT)
    top.only(*TABLES)
    machine = top.text("machine", "")
    header = contents_of(top, None, of_kinds=True) if top.has("nests") else None
    setup = setup_of(top, {}) if top.has("instruments") or top.has("planes") else None
    if header is not None and header.setup is not None and not (header.setup.nests or setup):
        header = replace(header, setup=None)  # nothing that version 1 cannot say
    layout = layout_of(top.table("file", required=False))
    actuators, commanded = _commanded(top)
    readings = tuple(_readings(top))
    sigma = sigma_of(top.table("sigma"), readings[0].kind)
    nest = text_of(top, "nest")
    if nest is None and not all(reading.nest for reading in readings):
        raise top.wrong(
            "nothing says in which nest a reading was", "nest",
            remedy='Add [nest] with column = "...", or nest = "..." to every [[reading]]',
        )  # fmt: skip
    pose = text_of(top, "pose")
    if pose is None:
        raise top.wrong(
            "nothing says which poses belong together", "pose",
            remedy='Add [pose] with column = "...", same_joints = true or each_row = true',
        )  # fmt: skip
    commands = None
    if top.has("commands"):
        table = top.table("commands")
        key = text_of(table, "pose")
        if key is None:
            raise table.wrong("no column has the label of the pose", "pose", remedy="Add pose")
        commands = Commands(layout_of(table.table("file", required=False)), key)
        table.end()
    return ImportMap(
        source,
        layout,
        machine,
        header,
        setup,
        _time(top.table("time")),
        pose,
        nest,
        text_of(top, "station"),
        text_of(top, "only"),
        actuators,
        commanded,
        readings,
        sigma,
        {name: _channel(one) for name, one in _tables(top.named("channels", required=False))},
        commands,
    )


def _tables(named: TomlTable) -> list[tuple[str, TomlTable]]:
    return [(name, named.table(name)) for name in named]


def _commanded(top: TomlTable) -> tuple[Numbers | None, Commanded | None]:
    """Actuator coordinates, or commanded poses."""
    if top.has("actuators") == top.has("commanded_pose"):
        raise top.wrong(
            "the map names both actuators and commanded poses"
            if top.has("actuators")
            else "nothing says what was commanded",
            "actuators",
            remedy="Write one of [actuators] and [commanded_pose]",
        )
    if top.has("actuators"):
        table = top.table("actuators")
        actuators = numbers_of(table, None, ("",))
        table.end()
        return actuators, None
    table = top.table("commanded_pose")
    pose = _pose(table)
    table.end()
    return None, pose


def _pose(table: TomlTable) -> Commanded:
    """Read where the numbers of a pose stand, and what its rotation is."""
    rotation = table.text("rotation")
    angles = re.fullmatch(r"[xyz]{3}|[XYZ]{3}", rotation) and rotation[1] not in rotation[::2]
    if rotation not in ROTATIONS and not angles:
        raise table.wrong(
            f"rotation is {rotation!r}", "rotation",
            remedy='Write the order of the angles: "XYZ" about the axes that turned before, "xyz" '
            f"about fixed ones; or {', '.join(ROTATIONS)}",
        )  # fmt: skip
    quaternion = rotation.startswith("quaternion")
    place, turn = table.table("place"), table.table("turn")
    found = Commanded(
        numbers_of(place, 3, ("mm",)),
        numbers_of(turn, 4 if quaternion else 3, ("1",) if quaternion else ("rad",)),
        rotation,
        table.place(),
    )
    for one in (place, turn):
        one.end()
    return found


def _readings(top: TomlTable) -> list[Reading]:
    found = []
    for table in top.tables("reading"):
        kind = table.choice("kind", KINDS, "xyz")
        nest = table.text("nest", "")
        instrument = table.text("instrument", "")
        if kind == "xyz":
            read = Reading(kind, numbers_of(table, 3, ("mm",)), nest)
        elif kind in NUMBERS:
            read = _one_number(table, kind, nest)
        elif kind == "pose":
            pose = _pose(table)
            read = Reading(kind, pose.place_numbers, nest, pose=pose)
        else:
            read = _spherical(table, kind, nest)
        found.append(replace(read, instrument=instrument))
        table.end()
        if found[-1].kind != found[0].kind:
            raise table.wrong(
                "readings of two kinds", "kind", remedy="Import them by a map each, to a run each"
            )
    if not found:
        raise top.wrong(
            "nothing says where a reading stands", "reading",
            remedy='Add [[reading]] with columns = ["X", "Y", "Z"] and unit = "mm"',
        )  # fmt: skip
    return found


def _one_number(table: TomlTable, kind: str, nest: str) -> Reading:
    nest2, plane = table.text("nest2", ""), table.text("plane", "")
    if nest2 and kind != "distance":
        raise table.wrong(f"a {kind} has no other end", "nest2", remedy="Leave nest2 out")
    if plane and kind != "direction":
        raise table.wrong(f"a {kind} touches no plane", "plane", remedy="Leave plane out")
    if not table.has("value"):
        numbers = numbers_of(table, 1, (NUMBERS[kind],))
        return Reading(kind, numbers, nest, nest2=nest2, plane=plane)
    if table.has("columns"):
        raise table.wrong("value and columns both say what is read", "value", remedy="Keep one")
    none = Numbers((), (), (), (), (), (), table.place("value"))
    value = table.quantity("value", NUMBERS[kind], 0.0)
    return Reading(kind, none, nest, nest2=nest2, plane=plane, value=value)


def _spherical(table: TomlTable, kind: str, nest: str) -> Reading:
    distance = None
    if kind == "spherical" and table.has("distance"):
        distance = table.quantity("distance", "mm", 0.0)
        if not distance > 0.0:
            raise table.wrong("a distance of zero has no direction", "distance")
    count = 3 if kind == "spherical" and distance is None else 2
    return Reading(
        kind,
        numbers_of(table, count, ("rad", "rad", "mm")[:count]),
        nest,
        distance,
        table.choice("vertical", VERTICAL),
        table.choice("horizontal", HORIZONTAL),
    )


def _channel(table: TomlTable) -> Channel:
    value = table.number("value") if table.has("value") else 0.0
    found = Channel(None if table.has("value") else numbers_of(table, 1, ("",), "column"), value)
    table.end()
    return found


def _time(table: TomlTable) -> Time:
    columns = columns_of(table, "column")
    sort = table.flag("sort", False)
    form = table.text("form", "s")
    if not columns:
        step = table.number("step_s", 0.0, unit="s", least=0.0)
        if step <= 0.0:
            raise table.wrong(
                "nothing says when a row was read", "column",
                remedy='Write column = "..." and form = "iso", "clock" or "s"; or step_s = 10.0',
            )  # fmt: skip
        table.end()
        return Time((), "s", None, step, table.place())
    if form not in FORMS and "%" not in form:
        raise table.wrong(
            f"form is {form!r}", "form",
            remedy='Write "s", "iso", "clock" (12:34:56), "excel", or a pattern: "%d.%m.%Y %H:%M"',
        )  # fmt: skip
    unit = table.text("unit", "")
    found = unit_named(unit, table.place("unit"), "s") if unit else None
    table.end()
    return Time(columns, form, found, 0.0, table.place(), sort)
