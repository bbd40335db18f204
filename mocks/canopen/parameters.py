"""The controller's parameters: active set in RAM, stored set in a file, defaults in the EDS."""

import json
import math
import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from canopen import ObjectDictionary

from mocks.canopen.node import real64_block

KINEMATIC, COMPENSATION = range(0x2100, 0x2200), range(0x2200, 0x2300)
FORMAT = "pkmcal-nvm/1"
Address = tuple[int, int]


def addresses(od: ObjectDictionary, indices: range) -> dict[str, Address]:
    """Return parameter name -> (index, sub-index) of all entries in ``indices``, in their order."""
    found = {}
    for index in indices:
        if index in od:
            entry: Any = od[index]
            for sub in range(1, len(entry)):
                found[entry[sub].name] = (index, sub)
    return found


def acceptable(name: str, value: float, default: float) -> bool:
    """Whether ``value`` may be written: finite, and near enough to be meant.

    Kinematic parameters within 10 (mm or rad) of the default; pitch within 0.05; lost motion 0..1;
    a cyclic period 0 (off) or 0.01..100; table points within 1.
    """
    if not math.isfinite(value):
        return False
    if name.startswith("screw-pitch."):
        return abs(value) <= 0.05
    if name.startswith("backlash."):
        return 0.0 <= value <= 1.0
    if name.startswith("screw-cyclic-table."):
        return value == 0.0 or 0.01 <= value <= 100.0 if name.endswith("period") else abs(value) < 1
    return abs(value - default) <= 10.0


class ParameterSet:
    """Named values in the order of the dictionary, with the CRC-32 over them.

    Parameters
    ----------
    od : the controller's object dictionary
    nvm_path : where the stored set survives a power cycle; None keeps it in memory only
    """

    def __init__(self, od: ObjectDictionary, nvm_path: Path | None) -> None:
        self.kinematic = addresses(od, KINEMATIC)
        self.compensation = addresses(od, COMPENSATION)
        self.address = self.kinematic | self.compensation
        self.name = {address: name for name, address in self.address.items()}
        self.defaults: dict[str, float] = {
            name: float(_variable(od, address).default or 0.0)
            for name, address in self.address.items()
        }
        self.active = dict(self.defaults)
        self.stored: dict[str, float] | None = None
        self._path = nvm_path

    def boot(self) -> bool:
        """Take the stored set into use, else the defaults; False if the memory is damaged."""
        intact = True
        if self._path is not None:
            self.stored, intact = self._read_memory(self._path)
        self.active = dict(self.kept)
        return intact

    def store(self) -> None:
        """Keep the active set."""
        self.stored = dict(self.active)
        self._write_memory()

    @property
    def kept(self) -> dict[str, float]:
        """What the next boot would take: the stored set, else the defaults."""
        return self.stored or self.defaults

    def forget(self) -> None:
        """Forget the stored set: the next boot takes the defaults (0x1011)."""
        self.stored = None
        if self._path is not None:
            self._path.unlink(missing_ok=True)

    def reload(self) -> None:
        """Bring the stored set, or else the defaults, back into use."""
        self.active = dict(self.kept)

    def checksum(self, values: Mapping[str, float] | None = None) -> int:
        """CRC-32 (zlib) over the little-endian REAL64 values, kinematic then compensation."""
        chosen = self.active if values is None else values
        return zlib.crc32(real64_block([chosen[name] for name in self.address], 0)[:-4])

    def _read_memory(self, path: Path) -> tuple[dict[str, float] | None, bool]:
        if not path.exists():
            return None, True
        try:
            memory = json.loads(path.read_text(encoding="utf-8"))
            values = {name: float.fromhex(memory["values"][name]) for name in self.address}
            if memory["format"] != FORMAT or self.checksum(values) != memory["crc32"]:
                return None, False
        except (ValueError, KeyError, TypeError):
            return None, False
        return values, True

    def _write_memory(self) -> None:
        if self._path is None or self.stored is None:
            return
        memory = {
            "format": FORMAT,
            "crc32": self.checksum(self.stored),
            "values": {name: value.hex() for name, value in self.stored.items()},
        }
        partial = self._path.with_name(self._path.name + ".partial")
        with partial.open("w", encoding="utf-8") as file:
            json.dump(memory, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(self._path)


def _variable(od: ObjectDictionary, address: Address) -> Any:
    entry: Any = od[address[0]]
    return entry[address[1]]
