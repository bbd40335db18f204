"""Which parameters the controller has, and their memories.

The identifiers are this project's own: no maker publishes any for kinematic parameters. Items of
the group ``limb`` are the limbs 1, 2, 3; all others belong to the controller, item 1.
"""

import json
import math
import os
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mocks.gcs.tripod_kinematics import LIMBS

FORMAT = "pkmcal-gcs-nvm/1"
Key = tuple[str, int]
"""Item and identifier."""


@dataclass(frozen=True)
class Entry:
    """One line of ``HPA?``: what an identifier means and who may write it.

    ``level`` is the command level that writing needs; None for a parameter that is read only.
    """

    number: int
    level: int | None
    items: int
    type: str
    group: str
    says: str

    def line(self) -> str:
        """Render the line of ``HPA?``."""
        level = 3 if self.level is None else self.level
        fields = (level, self.items, self.type, self.group, self.says)
        return f"0x{self.number:X}=\t" + "\t".join(map(str, fields))


QUANTITIES = {0x7F010001: "l0", 0x7F010002: "h", 0x7F010003: "theta"}
STRUCTURE_TEMP, PAYLOAD = 0x7F020001, 0x7F020002
CRC_IN_USE, CRC_STORED, WATCHDOG = 0x7F030001, 0x7F030002, 0x7F030003

ENTRIES = (
    *(Entry(n, 1, len(LIMBS), "FLOAT", "limb", what) for n, what in QUANTITIES.items()),
    Entry(STRUCTURE_TEMP, None, 1, "FLOAT", "channel", "structure_temp_C"),
    Entry(PAYLOAD, None, 1, "FLOAT", "channel", "payload_kg"),
    Entry(CRC_IN_USE, None, 1, "INT", "system", "CRC-32 of the limbs' parameters in use"),
    Entry(CRC_STORED, None, 1, "INT", "system", "CRC-32 of the limbs' parameters stored"),
    Entry(WATCHDOG, 0, 1, "INT", "system", "PC watchdog in ms, 0 = off"),
)
BY_NUMBER = {entry.number: entry for entry in ENTRIES}
NAMES: dict[Key, str] = {
    (str(item), number): f"{limb}.{what}"
    for item, limb in enumerate(LIMBS, start=1)
    for number, what in QUANTITIES.items()
}
"""Kinematic parameters by the names of the machine file, in the order of the checksum."""
KEYS = {name: key for key, name in NAMES.items()}


def checksum(values: Mapping[str, float]) -> int:
    """CRC-32 (that of zlib) over the little-endian REAL64 values: limb by limb l0, h, theta."""
    return zlib.crc32(b"".join(struct.pack("<d", values[name]) for name in KEYS))


def acceptable(value: float, default: float) -> bool:
    """Whether a kinematic parameter may be written: finite, within 10 (mm or rad) of nominal."""
    return math.isfinite(value) and abs(value - default) <= 10.0


class ParameterMemory:
    """The kinematic parameters: those in use (RAM), those stored (a file), the defaults.

    Parameters
    ----------
    defaults : nominal values by name, mm and rad
    nvm_path : file of the stored set; None keeps it in memory only
    """

    def __init__(self, defaults: Mapping[str, float], nvm_path: Path | None) -> None:
        self.defaults = {name: float(defaults[name]) for name in KEYS}
        self.active = dict(self.defaults)
        self._stored: dict[str, float] | None = None
        self._path = nvm_path

    @property
    def stored(self) -> dict[str, float]:
        """What the next start takes: the stored set, else the defaults."""
        return self._stored if self._stored is not None else self.defaults

    def start(self) -> bool:
        """Take the stored set into use, else the defaults; False if the memory is damaged."""
        intact = True
        if self._path is not None:
            self._stored, intact = _read(self._path)
        self.active = dict(self.stored)
        return intact

    def store(self, changes: Mapping[str, float]) -> None:
        """Change values of the stored set; the parameters in use stay as they are."""
        self._stored = {**self.stored, **changes}
        if self._path is not None:
            _write(self._path, self._stored)


def _read(path: Path) -> tuple[dict[str, float] | None, bool]:
    if not path.exists():
        return None, True
    try:
        memory = json.loads(path.read_text(encoding="utf-8"))
        values = {name: float.fromhex(memory["values"][name]) for name in KEYS}
        whole = memory["format"] == FORMAT and memory["crc32"] == checksum(values)
    except (ValueError, KeyError, TypeError):
        return None, False
    return (values, True) if whole else (None, False)


def _write(path: Path, values: Mapping[str, float]) -> None:
    memory = {
        "format": FORMAT,
        "crc32": checksum(values),
        "values": {name: value.hex() for name, value in values.items()},
    }
    partial = path.with_name(path.name + ".partial")
    with partial.open("w", encoding="utf-8") as file:
        json.dump(memory, file, indent=1)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
