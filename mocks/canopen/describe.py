"""The tables of docs/protocols/canopen.md, written from the EDS files.

``python -m mocks.canopen.describe`` replaces what stands between the marks in the document.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from canopen.objectdictionary import ODVariable

from drivers.canopen.eds import dictionary, eds_path
from mocks.canopen.eds_text import ARRAY, RECORD, Object
from mocks.canopen.make_eds import controller_objects, drive_objects
from mocks.physics.truth import machine_file

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "protocols" / "canopen.md"
TYPE_NAMES = {
    0x02: "INTEGER8", 0x03: "INTEGER16", 0x04: "INTEGER32", 0x05: "UNSIGNED8",
    0x06: "UNSIGNED16", 0x07: "UNSIGNED32", 0x09: "VISIBLE_STRING", 0x0F: "DOMAIN",
    0x11: "REAL64",
}  # fmt: skip
Row = tuple[str, ...]
Units = Mapping[tuple[int, int], str]


def _table(head: Row, rows: Iterable[Row]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _units(objects: Iterable[Object]) -> Units:
    """The units, which an EDS file has no place for but in comments."""
    return {
        (obj.index, sub if obj.code in (ARRAY, RECORD) else 0): entry.unit
        for obj in objects
        for sub, entry in enumerate(obj.entries, start=1)
    }


def _rows(od: Any, indices: Iterable[int], units: Units) -> list[Row]:
    def _entry(variable: Any) -> Row:
        unit = units.get((variable.index, variable.subindex), "")
        return TYPE_NAMES[variable.data_type], variable.access_type, unit

    rows: list[Row] = []
    for index in indices:
        entry = od[index]
        if isinstance(entry, ODVariable):
            rows.append((f"0x{index:04X}", "", entry.name, *_entry(entry)))
            continue
        subs = [entry[sub] for sub in range(1, len(entry))]
        alike = len({_entry(sub) for sub in subs}) == 1 and len(subs) > 4
        if alike:
            names = f"{subs[0].name}, {subs[1].name}, ... {subs[-1].name}"
            rows.append((f"0x{index:04X}", f"1..{len(subs)}", names, *_entry(subs[0])))
        else:
            rows += [(f"0x{index:04X}", f"{s.subindex}", s.name, *_entry(s)) for s in subs]
    return rows


def _pdo_rows(od: Any) -> list[Row]:
    rows: list[Row] = []
    for first, direction in ((0x1400, "to the controller"), (0x1800, "from the controller")):
        for index in sorted(i for i in od if first <= i < first + 0x200):
            mapping = od[index + 0x200]
            mapped = [mapping[sub].default for sub in range(1, len(mapping))]
            names = ", ".join(od.get_variable(m >> 16, m >> 8 & 0xFF).name for m in mapped)
            rows.append((direction, f"{index - first + 1}", f"0x{od[index][1].default:03X}", names))
    return rows


def controller_tables(machine: str = "hexapod", node: int = 10) -> tuple[str, str]:
    """Return the tables of objects and of PDOs of a machine's controller."""
    od: Any = dictionary(eds_path(f"{machine}_controller"), node)
    units = _units(controller_objects(machine_file(machine)))
    objects = [i for i in sorted(od) if 0x2000 <= i < 0x6000]
    head = ("index", "sub", "name", "type", "access", "unit")
    return (
        _table(head, _rows(od, objects, units)),
        _table(("direction", "PDO", f"COB-ID (node {node})", "holds"), _pdo_rows(od)),
    )


def drive_table() -> str:
    """Return the table of the drive's CiA 402 objects."""
    od: Any = dictionary(eds_path("drive402"), 1)
    head = ("index", "sub", "name", "type", "access", "unit")
    return _table(head, _rows(od, [i for i in sorted(od) if i >= 0x6000], _units(drive_objects())))


def main() -> None:
    """Bring the document up to date."""
    text = DOCUMENT.read_text(encoding="utf-8")
    objects, pdos = controller_tables()
    for mark, table in (("objects", objects), ("pdos", pdos), ("drive", drive_table())):
        begin, end = f"<!-- {mark} -->\n", "\n<!-- end -->"
        before, _, rest = text.partition(begin)
        text = before + begin + table + end + rest.partition("<!-- end -->")[2]
    DOCUMENT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
