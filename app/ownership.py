"""Who owns a machine: one process at a time, and the others are told which.

The lock is an SQLite database held exclusively: the operating system lets go of it when the
process ends, however it ends, so a lock can never be stale. Who holds it is written beside it.
"""

import hashlib
import json
import os
import platform
import sqlite3
from datetime import UTC, datetime
from pathlib import Path

import platformdirs

from app.errors import GateRefused


def state_folder() -> Path:
    """Where the program keeps what belongs to this computer; PKMCAL_STATE overrides it."""
    chosen = os.environ.get("PKMCAL_STATE")
    return Path(chosen) if chosen else platformdirs.user_state_path("pkmcal", False)


class Ownership:
    """Exclusive use of one machine, from :meth:`take` to :meth:`release`."""

    def __init__(self, machine: str, folder: Path | None = None) -> None:
        root = folder or state_folder() / "owners"
        name = hashlib.sha256(machine.encode()).hexdigest()[:16]
        self.machine = machine
        self._root = root
        self._lock = root / f"{name}.lock"
        self._note = root / f"{name}.json"
        self._held: sqlite3.Connection | None = None

    def take(self) -> None:
        """Own the machine; raises :class:`GateRefused` naming the owner if someone else does."""
        if self._held:
            return
        self._root.mkdir(parents=True, exist_ok=True)
        held = sqlite3.connect(self._lock, timeout=0.0, isolation_level=None)
        try:
            held.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            held.close()
            raise GateRefused(
                f"{self.machine} is in use by {self._owner()}",
                remedy="End that session first; one process at a time owns a machine",
            ) from error
        self._held = held
        note = {
            "machine": self.machine,
            "pid": os.getpid(),
            "host": platform.node(),
            "since": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        self._note.write_text(json.dumps(note), encoding="utf-8")

    def release(self) -> None:
        """Let go of the machine."""
        if self._held:
            self._note.unlink(missing_ok=True)
            self._held.close()
            self._held = None

    def _owner(self) -> str:
        try:
            note = json.loads(self._note.read_text(encoding="utf-8"))
            return f"process {note['pid']} on {note['host']} since {note['since']}"
        except (OSError, ValueError, KeyError):
            return "another process"
