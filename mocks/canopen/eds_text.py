"""EDS files (CiA 306) written from short tables of objects.

They say what CiA 306 knows and nothing else: a number of a REAL type is written as its IEEE 754
pattern in hexadecimal, most significant byte first, and a unit stands in a comment.
"""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

# CiA 301 data types and object codes.
TYPES = {
    "I8": 0x02, "I16": 0x03, "I32": 0x04, "U8": 0x05, "U16": 0x06, "U32": 0x07,
    "STRING": 0x09, "DOMAIN": 0x0F, "REAL64": 0x11,
}  # fmt: skip
BITS = {"I8": 8, "I16": 16, "I32": 32, "U8": 8, "U16": 16, "U32": 32, "REAL64": 64}
VAR, ARRAY, RECORD, DOMAIN = 0x7, 0x8, 0x9, 0x2


@dataclass(frozen=True)
class Entry:
    """One variable: a sub-index of an object, or the object itself.

    ``access`` is ``ro``, ``rw``, ``wo`` or ``const``; ``default`` is written as it stands, so that
    ``"$NODEID+0x80"`` is possible; ``pdo`` says that it may be mapped into a PDO.
    """

    name: str
    kind: str
    access: str = "ro"
    default: str | int | float | None = None
    unit: str = ""
    pdo: bool = False


@dataclass(frozen=True)
class Object:
    """One index of the dictionary: a variable (one entry) or an array or record of entries.

    ``used``: of an array whose number of entries may be written, how many of them count at first.
    """

    index: int
    name: str
    entries: tuple[Entry, ...]
    code: int = VAR
    used: int | None = None


def variable(index: int, entry: Entry) -> Object:
    """Return an object that is a single variable."""
    return Object(index, entry.name, (entry,), DOMAIN if entry.kind == "DOMAIN" else VAR)


def array(index: int, name: str, entries: Sequence[Entry], used: int | None = None) -> Object:
    """Return an object whose entries all have one type; sub-index 0 counts them."""
    return Object(index, name, tuple(entries), ARRAY, used)


def record(index: int, name: str, entries: Sequence[Entry]) -> Object:
    """Return an object whose entries have different types; sub-index 0 counts them."""
    return Object(index, name, tuple(entries), RECORD)


def _value(entry: Entry) -> str:
    default = entry.default
    if entry.kind == "REAL64":
        return f"0x{struct.pack('>d', float(default or 0.0)).hex().upper()}"
    if isinstance(default, int) and entry.kind in ("U32", "U16") and default > 255:
        return f"0x{default:X}"
    return str(default)


def _section(title: str, entry: Entry) -> list[str]:
    unit = [f"; in {entry.unit}"] if entry.unit else []
    lines = [
        f"[{title}]",
        f"ParameterName={entry.name}",
        f"ObjectType=0x{DOMAIN if entry.kind == 'DOMAIN' else VAR:X}",
        f"DataType=0x{TYPES[entry.kind]:04X}",
        f"AccessType={entry.access}",
        f"PDOMapping={int(entry.pdo)}",
    ]
    if entry.default is not None:
        lines.insert(5, f"DefaultValue={_value(entry)}")
    return [*lines, *unit, ""]


def _object_lines(obj: Object) -> list[str]:
    title = f"{obj.index:04X}"
    if obj.code in (VAR, DOMAIN):
        return _section(title, obj.entries[0])
    lines = [
        f"[{title}]",
        f"ParameterName={obj.name}",
        f"ObjectType=0x{obj.code:X}",
        f"SubNumber={len(obj.entries) + 1}",
        "",
    ]
    count = Entry("Number of entries", "U8", "ro", len(obj.entries))
    if obj.used is not None:
        count = Entry("Number of entries", "U8", "rw", obj.used)
    lines += _section(f"{title}sub0", count)
    for sub, entry in enumerate(obj.entries, start=1):
        lines += _section(f"{title}sub{sub:X}", entry)
    return lines


def _list(title: str, objects: Sequence[Object]) -> list[str]:
    rows = [f"{n}=0x{obj.index:04X}" for n, obj in enumerate(objects, start=1)]
    return [f"[{title}]", f"SupportedObjects={len(objects)}", *rows, ""]


def eds_text(file_name: str, product: str, product_code: int, objects: Iterable[Object]) -> str:
    """Return the text of an EDS file with ``objects`` in the order of their indices."""
    ordered = sorted(objects, key=lambda obj: obj.index)
    mandatory = [obj for obj in ordered if obj.index in (0x1000, 0x1001, 0x1018)]
    manufacturer = [obj for obj in ordered if 0x2000 <= obj.index <= 0x5FFF]
    optional = [obj for obj in ordered if obj not in mandatory and obj not in manufacturer]
    rpdos = sum(0x1400 <= obj.index < 0x1600 for obj in ordered)
    tpdos = sum(0x1800 <= obj.index < 0x1A00 for obj in ordered)
    lines = [
        "[FileInfo]", f"FileName={file_name}", "FileVersion=1", "FileRevision=1",
        "EDSVersion=4.0", f"Description={product}", "",
        "[DeviceInfo]", "VendorName=pkmcal", "VendorNumber=0x504B4D43", f"ProductName={product}",
        f"ProductNumber=0x{product_code:X}", "RevisionNumber=0x10000", "BaudRate_125=1",
        "BaudRate_250=1", "BaudRate_500=1", "BaudRate_1000=1", "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1", "Granularity=8", "DynamicChannelsSupported=0",
        "GroupMessaging=0", f"NrOfRXPDO={rpdos}", f"NrOfTXPDO={tpdos}", "LSS_Supported=0", "",
    ]  # fmt: skip
    lines += _list("MandatoryObjects", mandatory)
    lines += _list("OptionalObjects", optional)
    lines += _list("ManufacturerObjects", manufacturer)
    for obj in ordered:
        lines += _object_lines(obj)
    return "\n".join(lines)


# ---------------------------------------------------------------- objects that every node has


def communication_objects(product: str, code: int, device_type: int, serial: int) -> list[Object]:
    """Return the objects of CiA 301 that all our nodes have."""
    return [
        variable(0x1000, Entry("Device type", "U32", "ro", device_type)),
        variable(0x1001, Entry("Error register", "U8", "ro", 0)),
        array(0x1003, "Pre-defined error field", [Entry("Last error", "U32", "ro", 0)]),
        variable(0x1008, Entry("Manufacturer device name", "STRING", "const", product)),
        variable(0x1009, Entry("Manufacturer hardware version", "STRING", "const", "A")),
        variable(0x100A, Entry("Manufacturer software version", "STRING", "const", "1.0.0")),
        array(0x1010, "Store parameters", [Entry("Save all parameters", "U32", "rw", 1)]),
        array(0x1011, "Restore default parameters", [Entry("Restore all", "U32", "rw", 1)]),
        variable(0x1014, Entry("COB-ID EMCY", "U32", "ro", "$NODEID+0x80")),
        array(
            0x1016, "Consumer heartbeat time", [Entry("Consumer 1", "U32", "rw", 0, "node<<16|ms")]
        ),
        variable(0x1017, Entry("Producer heartbeat time", "U16", "rw", 100, "ms")),
        record(
            0x1018,
            "Identity object",
            [
                Entry("Vendor-ID", "U32", "ro", 0x504B4D43),
                Entry("Product code", "U32", "ro", code),
                Entry("Revision number", "U32", "ro", 0x10000),
                Entry("Serial number", "U32", "ro", serial),
            ],
        ),
        record(
            0x1200,
            "SDO server parameter",
            [
                Entry("COB-ID client to server", "U32", "ro", "$NODEID+0x600"),
                Entry("COB-ID server to client", "U32", "ro", "$NODEID+0x580"),
            ],
        ),
    ]


def pdo_objects(
    number: int, receive: bool, mapped: Sequence[tuple[int, int, str]]
) -> tuple[Object, Object]:
    """Return communication and mapping record of one PDO; ``number`` counts from 1.

    The first four use the pre-defined COB-IDs of the node, the next four those of node + 1: the
    node numbers that follow a controller with many PDOs stay free for it.
    """
    block, place = divmod(number - 1, 4)
    base = (0x200 if receive else 0x180) + 0x100 * place + block
    first, direction = (0x1400, "RPDO") if receive else (0x1800, "TPDO")
    communication = record(
        first + number - 1,
        f"{direction} {number} communication parameter",
        [
            Entry("COB-ID", "U32", "ro", f"$NODEID+0x{base:X}"),
            Entry("Transmission type", "U8", "ro", 255),
        ],
    )
    mapping = array(
        first + 0x200 + number - 1,
        f"{direction} {number} mapping parameter",
        [
            Entry(f"Mapped object {n}", "U32", "ro", index << 16 | sub << 8 | BITS[kind])
            for n, (index, sub, kind) in enumerate(mapped, start=1)
        ],
    )
    return communication, mapping
