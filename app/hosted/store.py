"""Where the host keeps its parameter sets: a folder with a file for each, never changed again.

The set in use is the one with the highest number. A file is written beside, flushed to the disk
and renamed, and the folder is flushed too: after a power cut there is the old set or the new one.
Every file carries a checksum over all that it says, so one that is torn or was edited by hand is
refused, not computed with.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.files.text import read_text
from app.hosted.parameters import DEVICE, ParameterSet
from app.ownership import Ownership, state_folder
from app.surely import write_surely
from calib.errors import BadInput
from calib.mechanism.description import Machine
from drivers.errors import DeviceError, ParameterError, Refused
from drivers.interface import Identity

FORMAT = "pkm-host-set/1"
_NUMBERED = re.compile(r"(\d{4,})\.json")


class HostStore:
    """Parameter sets of one machine, owned by this process from :meth:`open` to :meth:`close`."""

    def __init__(self, folder: Path, machine: Machine) -> None:
        self.folder = folder
        self._machine = machine
        self._owner = Ownership(f"the host store {folder}", folder)

    def open(self) -> None:
        """Own the store.

        Raises
        ------
        GateRefused
            If another process owns it.
        DeviceError
            If the folder cannot be made.
        """
        try:
            self._owner.take()
        except OSError as error:
            raise DeviceError(
                f"the folder cannot be used: {error}",
                device=f"{DEVICE} {self.folder}",
                remedy="Name another folder with store = ... under [controller]",
            ) from error

    def close(self) -> None:
        """Let go of it."""
        self._owner.release()

    def numbers(self) -> list[int]:
        """Numbers of the sets that are there, the oldest first."""
        found = (_NUMBERED.fullmatch(path.name) for path in self.folder.glob("*.json"))
        return sorted(int(match[1]) for match in found if match)

    def path(self, number: int) -> Path:
        """File of a set."""
        return self.folder / f"{number:04d}.json"

    def load(self) -> tuple[int, ParameterSet]:
        """The set in use and its number; nominal values and 0 where none was ever stored.

        Raises
        ------
        ParameterError
            If its file is torn, was edited by hand, or is of another machine; how an earlier set
            is brought back is said.
        """
        numbers = self.numbers()
        if not numbers:
            return 0, ParameterSet.nominal(self._machine)
        path = self.path(numbers[-1])
        try:
            return numbers[-1], self._read(path)
        except (BadInput, ValueError, KeyError, TypeError, AttributeError) as error:
            what = error.what if isinstance(error, BadInput) else str(error)
        except Refused as error:
            what = error.what
        raise ParameterError(
            f"{path} cannot be used: {what}",
            device=DEVICE,
            remedy="Bring a known set back: pkmcal undo --to NUMBER (pkmcal undo --list shows "
            "them); nothing moves until then",
        )

    def save(self, chosen: ParameterSet) -> int:
        """Write a set under the next number; it is on the disk when this returns its number.

        Raises
        ------
        DeviceError
            If the disk does not take it; the set in use is as it was.
        """
        number = max(self.numbers(), default=0) + 1
        said = {
            "format": FORMAT,
            "number": number,
            "machine": self._machine.name,
            "stored_utc": datetime.now(UTC).isoformat(timespec="seconds"),
            "values": dict(chosen.values),
            "own_effects": dict(chosen.own),
        }
        text = json.dumps({**said, "sha256": _digest(said)}, indent=1, ensure_ascii=False)
        try:
            write_surely(self.path(number), text, private=True)
        except OSError as error:
            raise DeviceError(
                f"the set cannot be written: {error}",
                device=f"{DEVICE} {self.folder}",
                remedy="The stored set is as it was. Make room on the disk, then try again",
            ) from error
        return number

    def _read(self, path: Path) -> ParameterSet:
        data = json.loads(read_text(path))
        if data.get("format") != FORMAT:
            raise ValueError(f"its format is {data.get('format')!r}, not {FORMAT!r}")
        told = data.pop("sha256", None)
        if told != _digest(data):
            raise ValueError("its checksum is not that of its text: it was edited, or is damaged")
        if self.path(data["number"]) != path:
            raise ValueError(f"it is set {data['number']}, under another's name")
        if data["machine"] != self._machine.name:
            raise ValueError(f"it is of the machine {data['machine']}")
        values = {name: float(value) for name, value in data["values"].items()}
        return ParameterSet(values, data["own_effects"]).checked(self._machine)


def usual_folder(machine: Machine, identity: Identity) -> Path:
    """Where a store is if the site file does not say: by machine and serial number."""
    who = f"{machine.name}-{identity.serial or 'no-serial'}"
    return state_folder() / "host-store" / re.sub(r"[^A-Za-z0-9_.-]+", "_", who)


def _digest(said: Mapping[str, Any]) -> str:
    """SHA-256 over everything that a set says, whatever the blanks between."""
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode("utf-8")).hexdigest()
