"""How a map names columns: labels with patterns, numbers with units, signs, gears and offsets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from app.files.foreign_table import Column
from app.files.patterns import find, pattern_of
from calib.quantity import measured, quantity
from calib.toml_table import TomlTable
from calib.units import Unit, unit_named

ALL_ACTUATORS = "q*"
"""Columns q1, q2 and so on, as many as the machine has actuators."""


@dataclass(frozen=True)
class Text:
    """A label: cells joined by "/", of which ``pattern`` finds a part; ``names`` renames it."""

    columns: tuple[Column, ...]
    pattern: str = ""
    names: Mapping[str, str] = field(default_factory=dict)
    place: str = ""
    same_joints: bool = False
    each_row: bool = False

    def label(self, cells: Sequence[str], place: str) -> str:
        """The label in the cells of one row at ``place``; "" where the pattern finds nothing."""
        whole = "/".join(cells)
        if self.pattern:
            found = find(self.pattern, whole, place)
            if found is None:
                return ""
            whole = next((part for part in found.groups() if part is not None), found.group(0))
        return self.names.get(whole, whole)


@dataclass(frozen=True)
class Numbers:
    """Columns of numbers: value = sign * scale * (number in its unit) / gear + offset.

    ``units`` has None where the file itself states one. ``scale`` is (number, unit): what one count
    is ("mm", "rad"), what one unit makes ("mm/rad"), or a plain factor (""). ``place`` is that of
    the map.
    """

    columns: tuple[Column, ...]
    base: tuple[str, ...]
    units: tuple[Unit | None, ...]
    sign: tuple[float, ...]
    gear: tuple[float, ...]
    offset: tuple[float, ...]
    place: str
    scale: tuple[tuple[float, str], ...] = ()

    def for_each(self, columns: Sequence[Column]) -> "Numbers":
        """The same of other columns: what is stated of the first holds for all of them."""
        count = len(columns)
        return Numbers(
            tuple(columns),
            self.base[:1] * count,
            self.units[:1] * count,
            self.sign[:1] * count,
            self.gear[:1] * count,
            self.offset[:1] * count,
            self.place,
            self.scale[:1] * count,
        )


def columns_of(table: TomlTable, key: str, count: int | None = None) -> tuple[Column, ...]:
    """Columns by names and numbers: one, or a list."""
    value = table.raw(key, "text, whole number or list")
    found = value if isinstance(value, list) else [] if value is None else [value]
    good = all(
        (isinstance(one, str) and one) or (isinstance(one, int) and not isinstance(one, bool))
        for one in found
    )
    if not good or (count is not None and len(found) != count):
        many = f"{count} columns" if count else "a column"
        raise table.wrong(
            f"{key} is {value!r}", key, remedy=f"Write {many}, by name in quotes or by number"
        )
    return tuple(found)


def text_of(top: TomlTable, key: str) -> Text | None:
    """Read a table that says where a label stands; None where it is missing."""
    if not top.has(key):
        return None
    table = top.table(key)
    names = {name: str(value) for name, value in _texts(table.named("names", required=False))}
    text = Text(
        columns_of(table, "column"),
        pattern_of(table, "pattern"),
        names,
        table.place(),
        same_joints=key == "pose" and table.flag("same_joints", False),
        each_row=key == "pose" and table.flag("each_row", False),
    )
    table.end()
    if not text.columns and not text.same_joints and not text.each_row:
        raise table.wrong("no column is named", "column", remedy='Write column = "..."')
    return text


def _texts(named: TomlTable) -> list[tuple[str, str]]:
    return [(name, named.text(name)) for name in named]


def _listed(table: TomlTable, key: str, count: int, default: object) -> list[object]:
    """One value for all columns, or one for each."""
    value = table.raw(key, "one value, or one for each column")
    if value is None:
        return [default] * count
    if not isinstance(value, list):
        return [value] * count
    if len(value) != count:
        raise table.wrong(f"{key} has {len(value)} values", key, remedy=f"Write one, or {count}")
    return list(value)


def numbers_of(
    table: TomlTable, count: int | None, base: Sequence[str], key: str = "columns"
) -> Numbers:
    """Read columns with unit, sign, gear and offset; ``base`` as many, or one for all."""
    columns = columns_of(table, key, count)
    if not columns:
        raise table.wrong("no columns are named", key, remedy=f"Write {key} = [...]")
    count = len(columns)
    bases = tuple(base) if len(base) == count else (base[0],) * count
    units = [
        None if one is None else _unit(table, one, own)
        for one, own in zip(_listed(table, "unit", count, None), bases, strict=True)
    ]
    return Numbers(
        columns,
        bases,
        tuple(units),
        tuple(_signs(table, count)),
        tuple(_gears(table, count)),
        tuple(
            quantity(one, own, table.place("offset"))
            if own in ("mm", "rad", "")
            else _plain(table, one)
            for one, own in zip(_listed(table, "offset", count, 0.0), bases, strict=True)
        ),
        table.place(key),
        tuple(measured(one, table.place("scale")) for one in _listed(table, "scale", count, 1.0)),
    )


def _unit(table: TomlTable, name: object, base: str) -> Unit:
    if not isinstance(name, str):
        raise table.wrong(f"unit is {name!r}", "unit", remedy='Write unit = "mm"')
    return unit_named(name, table.place("unit"), base)


def _plain(table: TomlTable, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise table.wrong(f"{value!r} is no number", remedy="Write a number")
    return float(value)


def _signs(table: TomlTable, count: int) -> list[float]:
    signs = _listed(table, "sign", count, 1)
    if any(isinstance(one, bool) or one not in (1, -1) for one in signs):
        raise table.wrong("a sign is 1 or -1", "sign", remedy="Write sign = [1, -1, ...]")
    return [_plain(table, one) for one in signs]


def _gears(table: TomlTable, count: int) -> list[float]:
    gears = [_plain(table, one) for one in _listed(table, "gear", count, 1.0)]
    if any(not 1e-9 < abs(one) < 1e9 for one in gears):
        raise table.wrong(
            "a gear ratio is not zero", "gear", remedy="Turns before it a turn behind"
        )
    return gears
