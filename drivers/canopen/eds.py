"""The EDS files that ship with the program: where they are, and what stands in them."""

import contextlib
import struct
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from canopen import ObjectDictionary, import_od
from canopen.objectdictionary import ODVariable, datatypes

from drivers.errors import DeviceError

EDS_FOLDER = Path(__file__).resolve().parents[1] / "eds"
FLOATS = {datatypes.REAL32: ">f", datatypes.REAL64: ">d"}
"""CiA 306 writes their defaults as IEEE 754 patterns, which the canopen package does not read."""


def eds_path(name: str) -> Path:
    """Return the path of ``drivers/eds/<name>.eds``; raises DeviceError if there is none."""
    path = EDS_FOLDER / f"{name}.eds"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in EDS_FOLDER.glob("*.eds")))
        raise DeviceError(
            f"no EDS file named {name!r}",
            device="controller",
            remedy=f"Those that ship are {known}. Write one of your own machine with pkmcal "
            "machine eds MACHINE, and name its path in the site file: eds = ... in [controller].",
        )
    return path


def drive_eds_path(machine: str) -> Path:
    """Return the path of the EDS file of a machine's drives: its own, else ``drive402.eds``."""
    own = EDS_FOLDER / f"{machine}_drive.eds"
    return own if own.is_file() else eds_path("drive402")


def dictionary(path: Path, node_id: int) -> ObjectDictionary:
    """Read the objects of an EDS file as those of a node; the same file is read once."""
    return _dictionary(str(path), path.stat().st_mtime_ns, node_id)


def need_dictionary(path: Path, node_id: int, device: str) -> ObjectDictionary:
    """Read the EDS file of a device; raises DeviceError if it cannot be read as one."""
    try:
        return dictionary(path, node_id)
    except Exception as error:  # the package's reader raises whatever the text leads it to
        raise DeviceError(
            f"{path} cannot be read as an EDS file: {error}",
            device=device,
            remedy="Name the EDS file of this very device in [controller]",
        ) from error


@lru_cache(maxsize=64)
def _dictionary(path: str, _changed_ns: int, node_id: int) -> ObjectDictionary:
    objects = import_od(path, node_id)
    for variable in _variables(objects):
        pattern = FLOATS.get(variable.data_type or 0)
        text = getattr(variable, "default_raw", "").strip().lower()
        if pattern is not None and text.startswith("0x"):
            with contextlib.suppress(ValueError, OverflowError, struct.error):
                size = struct.calcsize(pattern)
                (variable.default,) = struct.unpack(pattern, int(text, 16).to_bytes(size, "big"))
    return objects


def _variables(objects: ObjectDictionary) -> Iterator[ODVariable]:
    for entry in objects.values():
        if isinstance(entry, ODVariable):
            yield entry
        else:
            yield from entry.values()
