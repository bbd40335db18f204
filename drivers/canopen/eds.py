"""Where the EDS files are that ship with the program."""

from pathlib import Path

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
