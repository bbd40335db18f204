"""The SQLite file under a journal: its tables, checksums of what stands in them, faults in words.

SQLite notices a page that is no page any more; a digit that became another digit it does not. So
every entry has a checksum of its own, and an entry that was there can not be missing. Journals of
before, which have no checksums, are read as ever.
"""

import hashlib
import json
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.errors import BadInput

_SCHEMA = """
CREATE TABLE IF NOT EXISTS meta (
    key TEXT PRIMARY KEY, value TEXT NOT NULL, sum TEXT NOT NULL DEFAULT '');
CREATE TABLE IF NOT EXISTS steps (
    id TEXT PRIMARY KEY, position INTEGER NOT NULL, kind TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS log (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, step TEXT NOT NULL REFERENCES steps (id),
    state TEXT NOT NULL, attempt INTEGER NOT NULL, time_s REAL NOT NULL, utc TEXT NOT NULL,
    result TEXT NOT NULL, sum TEXT NOT NULL DEFAULT '');
CREATE TABLE IF NOT EXISTS rows (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, step TEXT NOT NULL, attempt INTEGER NOT NULL,
    kind TEXT NOT NULL CHECK (kind IN ('move', 'reading')),
    status TEXT NOT NULL DEFAULT 'good' CHECK (status IN ('good', 'rejected', 'invalidated')),
    why TEXT NOT NULL DEFAULT '', time_s REAL NOT NULL, utc TEXT NOT NULL, pose TEXT NOT NULL,
    nest TEXT NOT NULL, q TEXT NOT NULL, xyz TEXT, covariance TEXT, delay_s REAL, cycle INTEGER,
    channels TEXT NOT NULL, raw TEXT NOT NULL, sum TEXT NOT NULL DEFAULT '');
CREATE UNIQUE INDEX IF NOT EXISTS one_good_reading
    ON rows (step) WHERE kind = 'reading' AND status = 'good';
CREATE TABLE IF NOT EXISTS notes (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, time_s REAL NOT NULL, utc TEXT NOT NULL,
    kind TEXT NOT NULL, text TEXT NOT NULL);
"""
SUMMED = {
    "meta": ("key", "value"),
    "log": ("step", "state", "attempt", "time_s", "utc", "result"),
    "rows": (
        "step", "attempt", "kind", "time_s", "utc", "pose", "nest", "q", "xyz", "covariance",
        "delay_s", "cycle", "channels", "raw",
    ),
}  # fmt: skip
"""What the checksum of an entry is of; a row's status may change, and has its own check."""
_REMEDY = "Do not measure on with it: use a copy of before, or what run/ of the session holds"


def checksum(table: str, values: Mapping[str, Any]) -> str:
    """Of what an entry says."""
    said = json.dumps([values[name] for name in SUMMED[table]], default=repr)
    return hashlib.sha256(said.encode()).hexdigest()[:16]


def opened(path: Path, *, read_only: bool, checked: bool) -> sqlite3.Connection:
    """Open the file, made if it is not there; raises BadInput for what is none, or is damaged.

    ``checked``: every entry is looked at, which takes 10 us each.
    """
    if read_only and not path.is_file():
        raise BadInput("no journal here", place=str(path), remedy="Name a session's folder")
    target = f"{path.resolve().as_uri()}?mode=ro" if read_only else str(path)
    database = None
    try:
        database = sqlite3.connect(target, uri=read_only, isolation_level=None, timeout=5.0)
        database.row_factory = sqlite3.Row
        if not read_only:
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = FULL")
            database.executescript(_SCHEMA)
            _grow(database)
        database.execute("SELECT count(*) FROM meta").fetchone()
        if checked:
            _look_through(database, path)
    except (sqlite3.DatabaseError, ValueError, LookupError) as error:
        if database is not None:
            database.close()
        raise BadInput(
            f"not a journal of this program, or one that is damaged ({error})",
            place=str(path), remedy=_REMEDY,
        ) from error  # fmt: skip
    except BaseException:
        if database is not None:
            database.close()
        raise
    return database


def _grow(database: sqlite3.Connection) -> None:
    """Give a journal of before the column of checksums."""
    for table in SUMMED:
        if not _has_sums(database, table):
            database.execute(f"ALTER TABLE {table} ADD COLUMN sum TEXT NOT NULL DEFAULT ''")


def _has_sums(database: sqlite3.Connection, table: str) -> bool:
    return any(row["name"] == "sum" for row in database.execute(f"PRAGMA table_info({table})"))


def _look_through(database: sqlite3.Connection, path: Path) -> None:
    """Raise BadInput for a file that is damaged anywhere."""
    said = [row[0] for row in database.execute("PRAGMA integrity_check(1)")]
    if said != ["ok"]:
        raise _damaged(said[0], path)
    database.execute("BEGIN")  # one state of it, whoever writes meanwhile
    try:
        _check_entries(database, path)
    finally:
        database.execute("COMMIT")


def _check_entries(database: sqlite3.Connection, path: Path) -> None:
    """Compare every entry with its checksum, and count them."""
    for table in SUMMED:
        if not _has_sums(database, table):
            continue
        for row in database.execute(f"SELECT * FROM {table}"):
            if row["sum"] and row["sum"] != checksum(table, dict(row)):
                raise _damaged(f"an entry of {table} is not what was written ({row[0]!r})", path)
    for table in ("log", "rows"):
        count, last = database.execute(f"SELECT count(*), max(seq) FROM {table}").fetchone()
        given = database.execute(
            "SELECT seq FROM sqlite_sequence WHERE name = ?", (table,)
        ).fetchone()
        if count != (last or 0) or (given is not None and given[0] != count):
            raise _damaged(f"entries of {table} are missing", path)


def _damaged(what: str, path: Path) -> BadInput:
    return BadInput(f"the journal is damaged: {what}", place=str(path), remedy=_REMEDY)
