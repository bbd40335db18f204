"""Where machine descriptions are found: shipped with the program, or in a file of the lab's."""

from functools import cache
from pathlib import Path

import calib
from app.files.text import read_text
from calib.errors import BadInput
from calib.mechanism.check import require_sound
from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.mechanism.variants import with_closure

_SHIPPED = Path(calib.__file__).parent / "machines"


def shipped_machines() -> list[str]:
    """Names of the machines that ship with the program."""
    return sorted(file.stem for file in _SHIPPED.glob("*.toml"))


def load_machine(name_or_path: str, relative_to: Path | None = None) -> Machine:
    """Load a machine by the name of a shipped one, or from a machine file.

    Parameters
    ----------
    name_or_path : str
        ``"hexapod"``, or the path of a ``.toml`` file.
    relative_to : Path, optional
        Folder that a relative path starts from; the current one by default.

    Raises
    ------
    BadInput
        If there is no such machine, or its file cannot be used.
    """
    if name_or_path in shipped_machines():
        return _shipped(name_or_path)
    path = (relative_to or Path()) / name_or_path
    try:
        there = path.is_file()
    except (OSError, ValueError):  # longer than a name can be, or with signs that none has
        there = False
    if not there:
        raise BadInput(
            f'unknown machine "{name_or_path[:80]}"',
            remedy=f"Shipped machines: {', '.join(shipped_machines())}; or give the path of a "
            "machine file",
        )
    text = read_text(path)
    machine = parse_machine(text, str(path))
    require_sound(machine, text)
    return machine


@cache
def _shipped(name: str) -> Machine:
    """A shipped machine; nobody can change it, and what is derived from it is derived once."""
    text = (_SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    return parse_machine(text, f"{name}.toml")


def closed_machine(name_or_path: str, closure: str) -> Machine:
    """Load a machine; with ``closure`` another closure of an over-constrained machine's file."""
    machine = load_machine(name_or_path)
    return with_closure(machine, closure) if closure else machine
