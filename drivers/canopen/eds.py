"""The EDS files that ship with the program: where they are, and what stands in them."""

from functools import lru_cache
from pathlib import Path

from canopen import ObjectDictionary, import_od

from drivers.errors import DeviceError

EDS_FOLDER = Path(__file__).resolve().parents[1] / "eds"


def eds_path(name: str) -> Path:
    """Return the path of ``drivers/eds/<name>.eds``; raises DeviceError if there is none."""
    path = EDS_FOLDER / f"{name}.eds"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in EDS_FOLDER.glob("*.eds")))
        raise DeviceError(
            f"no EDS file named {name!r}",
            remedy=f"Name one of {known}, or a path in the site file.",
        )
    return path


def drive_eds_path(machine: str) -> Path:
    """Return the path of the EDS file of a machine's drives: its own, else ``drive402.eds``."""
    own = EDS_FOLDER / f"{machine}_drive.eds"
    return own if own.is_file() else eds_path("drive402")


def dictionary(path: Path, node_id: int) -> ObjectDictionary:
    """Read the objects of an EDS file as those of a node; the same file is read once."""
    return _dictionary(str(path), path.stat().st_mtime_ns, node_id)


@lru_cache(maxsize=64)
def _dictionary(path: str, _changed_ns: int, node_id: int) -> ObjectDictionary:
    return import_od(path, node_id)
