"""The database: every applied set, fit and verification, by machine; entries are only added.

It lies in the folder that holds the sessions. A fit of the same runs with the same effects takes
the place of the one before, as does a verification that is judged again.
"""

import json
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from app.plain_data import plain
from calib.errors import BadInput

FILE = "history.sqlite"
Kind = Literal["applied", "fit", "verification"]
_SCHEMA = """
CREATE TABLE IF NOT EXISTS entries (
    seq INTEGER PRIMARY KEY AUTOINCREMENT,
    kind TEXT NOT NULL CHECK (kind IN ('applied', 'fit', 'verification')),
    utc TEXT NOT NULL, machine TEXT NOT NULL, serial TEXT NOT NULL, source TEXT NOT NULL,
    said TEXT NOT NULL);
CREATE UNIQUE INDEX IF NOT EXISTS one_of_a_source
    ON entries (kind, machine, serial, source) WHERE kind <> 'applied';
"""


@dataclass(frozen=True)
class Entry:
    """One thing that happened to a machine.

    ``utc`` is when (ISO 8601), ``serial`` that of its controller ("" where it is not known),
    ``source`` the session, the runs with the effects, or the model file; ``said`` what was found.
    """

    kind: Kind
    utc: str
    machine: str
    serial: str
    source: str
    said: Mapping[str, Any]

    @property
    def when(self) -> datetime:
        """The moment, with its zone."""
        return datetime.fromisoformat(self.utc)


class History:
    """The history of the machines whose sessions lie in ``root``."""

    def __init__(self, root: Path) -> None:
        self.file = root / FILE

    def add(self, entry: Entry) -> None:
        """Keep an entry; raises :class:`BadInput` where the database cannot be written."""
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            with closing(self._open(f"file:{_quoted(self.file)}")) as database, database:
                database.executescript(_SCHEMA)
                database.execute(
                    "INSERT OR REPLACE INTO entries (kind, utc, machine, serial, source, said) "
                    "VALUES (?, ?, ?, ?, ?, ?)",
                    (
                        entry.kind, entry.utc, entry.machine, entry.serial, entry.source,
                        json.dumps(plain(entry.said)),
                    ),
                )  # fmt: skip
        except (sqlite3.Error, OSError) as error:
            raise BadInput(
                f"cannot write the history: {error}",
                place=str(self.file),
                remedy="Make room, or let this user write there",
            ) from error

    def entries(self, kind: Kind | None = None) -> list[Entry]:
        """Every entry, or those of a kind, the oldest first; raises BadInput for a broken file."""
        if not self.file.is_file():
            return []
        try:
            with closing(self._open(f"file:{_quoted(self.file)}?mode=ro")) as database:
                rows = database.execute(
                    "SELECT kind, utc, machine, serial, source, said FROM entries "
                    "WHERE ? IN (kind, '') ORDER BY utc, seq",
                    (kind or "",),
                ).fetchall()
        except sqlite3.Error as error:
            raise BadInput(
                f"not a history ({error})",
                place=str(self.file),
                remedy="Move the file away: a new one is begun, sessions and runs stay",
            ) from error
        return [
            Entry(what, utc, machine, serial, source, json.loads(said))
            for what, utc, machine, serial, source, said in rows
        ]

    def _open(self, address: str) -> sqlite3.Connection:
        return sqlite3.connect(address, uri=True, timeout=5.0)


def now_utc() -> str:
    """This moment, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _quoted(file: Path) -> str:
    return file.resolve().as_uri().removeprefix("file:")
