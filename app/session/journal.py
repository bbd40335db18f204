"""The truth about what happened: an SQLite journal with one writer.

Every step goes ``planned -> started(attempt) -> done | failed | skipped``. A reading and the end
of its step are one transaction, so that a process killed at any moment has the reading exactly
once or not at all. Rows are never deleted: a reading that is set aside keeps its row and the
reason.
"""

import errno
import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

from app.session.journal_file import checksum, opened
from app.session.kinds import KINDS
from app.session.plan import Plan
from app.session.rows import PLANNED, NewRow, Row, StepState, row_of
from calib.errors import BadInput

PARAMETERS, SMRS, FRAME = "controller_parameters", "smrs", "controller_frame"
IDENTITIES = "identities"
"""Facts about a session: what the controller held at connect, nest of each SMR by its number, what
the poses of a closed controller refer to."""
_GOOD_READING = "kind = 'reading' AND status = 'good'"


class Journal:
    """Opens, or creates, the journal of one session."""

    def __init__(self, path: Path, *, read_only: bool = False, checked: bool = True) -> None:
        self._db = opened(path, read_only=read_only, checked=checked)
        self._path, self._file = path, path.stat().st_ino
        self._states: dict[str, StepState] = {}
        self._seen = 0

    def close(self) -> None:
        """Close the database."""
        self._db.close()

    def _require_file(self) -> None:
        """Raise OSError if the file is no longer where it was: what is written would be lost."""
        try:
            there = self._path.stat().st_ino == self._file
        except FileNotFoundError:
            there = False
        if not there:
            what = "the journal was removed or replaced while it was written"
            raise FileNotFoundError(errno.ENOENT, what, str(self._path))

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._require_file()
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            if self._db.in_transaction:  # a full disk has taken it back already
                self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    # meta

    def set_meta(self, key: str, value: Any) -> None:
        """Remember a fact about the session."""
        self._db.execute(
            "INSERT INTO meta (key, value, sum) VALUES (:key, :value, :sum) ON CONFLICT (key) "
            "DO UPDATE SET value = excluded.value, sum = excluded.sum",
            _summed("meta", {"key": key, "value": json.dumps(value)}),
        )

    def meta(self, key: str, default: Any = None) -> Any:
        """Recall a fact about the session."""
        row = self._db.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return default if row is None else json.loads(row["value"])

    # steps

    def enter_plan(self, plan: Plan) -> None:
        """Enter every step as planned; a plan that is there already must be the same."""
        known = [row["id"] for row in self._db.execute("SELECT id FROM steps ORDER BY position")]
        ids = [step.id for step in plan.steps]
        if known:
            if known != ids:
                raise BadInput("journal and plan do not belong together", remedy="Measure anew")
            return
        with self._transaction():
            self._db.executemany(
                "INSERT INTO steps VALUES (?, ?, ?)",
                [(step.id, position, step.kind.name) for position, step in enumerate(plan.steps)],
            )

    def states(self) -> Mapping[str, StepState]:
        """State of every step that has a log entry, as the log says at this moment.

        Entries are only ever added, so what was read before is not read again.
        """
        rows = self._db.execute(
            "SELECT seq, step, state, attempt, result FROM log WHERE seq > ? ORDER BY seq",
            (self._seen,),
        )
        for row in rows:
            self._seen = row["seq"]
            self._states[row["step"]] = StepState(
                row["state"], row["attempt"], json.loads(row["result"]), row["seq"]
            )
        return MappingProxyType(self._states)

    def ended(self) -> int:
        """Count the steps that are done or skipped, without reading the whole log."""
        row = self._db.execute(
            "SELECT count(*) AS n FROM (SELECT state, max(seq) FROM log GROUP BY step) "
            "WHERE state IN ('done', 'skipped')"
        ).fetchone()
        return int(row["n"])

    def state(self, step: str) -> StepState:
        """State of one step."""
        return self.states().get(step, PLANNED)

    def last_entry(self) -> int:
        """Number of the last log entry; 0 before the first."""
        row = self._db.execute("SELECT max(seq) AS seq FROM log").fetchone()
        return int(row["seq"] or 0)

    def started(self, step: str, attempt: int, time_s: float, utc: str) -> None:
        """Write that a step begins."""
        self._log(step, "started", attempt, time_s, utc, {})

    def done(
        self,
        step: str,
        attempt: int,
        time_s: float,
        utc: str,
        result: Mapping[str, Any],
        reading: NewRow | None = None,
    ) -> int:
        """Write that a step ended well, together with its reading; returns the row's number."""
        with self._transaction():
            number = self._insert(step, attempt, utc, reading) if reading else 0
            self._log(step, "done", attempt, time_s, utc, result)
        return number

    def failed(self, step: str, attempt: int, time_s: float, utc: str, what: str) -> None:
        """Write that a step did not end well."""
        self._log(step, "failed", attempt, time_s, utc, {"what": what})

    def skipped(self, step: str, attempt: int, time_s: float, utc: str, why: str) -> None:
        """Write that a step is left out."""
        self._log(step, "skipped", attempt, time_s, utc, {"why": why})

    def _log(
        self, step: str, state: str, attempt: int, time_s: float, utc: str, result: Any
    ) -> None:
        self._require_file()
        self._db.execute(
            "INSERT INTO log (step, state, attempt, time_s, utc, result, sum) "
            "VALUES (:step, :state, :attempt, :time_s, :utc, :result, :sum)",
            _summed(
                "log",
                {
                    "step": step, "state": state, "attempt": attempt, "time_s": float(time_s),
                    "utc": utc, "result": json.dumps(result),
                },
            ),
        )  # fmt: skip

    def log(self, after: int = 0) -> list[tuple[str, float, str, str, dict[str, Any]]]:
        """Entries of the log after the first so many: UTC, time in s, step, state, result."""
        rows = self._db.execute(
            "SELECT utc, time_s, step, state, result FROM log WHERE seq > ? ORDER BY seq", (after,)
        )
        return [(*tuple(row)[:4], json.loads(row["result"])) for row in rows]

    # rows

    def add_row(self, step: str, attempt: int, utc: str, row: NewRow) -> int:
        """Write a move, or a reading that is set aside; returns its number."""
        with self._transaction():
            return self._insert(step, attempt, utc, row)

    def _insert(self, step: str, attempt: int, utc: str, row: NewRow) -> int:
        values = {
            "step": step, "attempt": attempt, "kind": row.kind, "status": row.status,
            "why": row.why, "time_s": float(row.time_s), "utc": utc, "pose": row.pose,
            "nest": row.nest, "q": json.dumps(row.q),
            "xyz": None if row.xyz is None else json.dumps(row.xyz),
            "covariance": None if row.covariance is None else json.dumps(row.covariance),
            "delay_s": None if row.delay_s is None else float(row.delay_s), "cycle": row.cycle,
            "channels": json.dumps(row.channels or {}), "raw": json.dumps(row.raw or {}),
        }  # fmt: skip
        names = [*values, "sum"]
        cursor = self._db.execute(
            f"INSERT INTO rows ({', '.join(names)}) VALUES (:{', :'.join(names)})",
            _summed("rows", values),
        )
        return cursor.lastrowid or 0

    def rows(self, *, good_only: bool = True) -> list[Row]:
        """Every move and reading in the order in which it happened."""
        where = "WHERE status = 'good'" if good_only else ""
        return [row_of(row) for row in self._db.execute(f"SELECT * FROM rows {where} ORDER BY seq")]

    def readings(self) -> int:
        """Count the good readings."""
        row = self._db.execute(f"SELECT count(*) AS n FROM rows WHERE {_GOOD_READING}").fetchone()
        return int(row["n"])

    def seen(self, nests: Iterable[str]) -> dict[str, list[tuple[float, float, float]]]:
        """Good readings (tracker frame, mm) of each of these nests that was read, in order."""
        wanted = set(nests)
        found: dict[str, list[tuple[float, float, float]]] = {}
        for row in self._db.execute(
            f"SELECT nest, xyz FROM rows WHERE {_GOOD_READING} AND xyz IS NOT NULL ORDER BY seq"
        ):
            if row["nest"] in wanted:
                x, y, z = json.loads(row["xyz"])
                found.setdefault(row["nest"], []).append((x, y, z))
        return found

    def sent_to(self, pose: str) -> tuple[float, ...]:
        """Where the machine was last sent for a pose; raises LookupError if it never was."""
        row = self._db.execute(
            "SELECT q FROM rows WHERE pose = ? ORDER BY seq DESC LIMIT 1", (pose,)
        ).fetchone()
        if row is None:
            raise LookupError(pose)
        return tuple(json.loads(row["q"]))

    def last_row(self) -> Row | None:
        """The last move or reading, whatever became of it."""
        row = self._db.execute("SELECT * FROM rows ORDER BY seq DESC LIMIT 1").fetchone()
        return row_of(row) if row else None

    def last_time(self) -> float:
        """Latest machine time that stands in the journal, s."""
        row = self._db.execute(
            "SELECT max(t) AS t FROM (SELECT max(time_s) AS t FROM log "
            "UNION ALL SELECT max(time_s) FROM rows)"
        ).fetchone()
        return float(row["t"] or 0.0)

    def invalidate(self, why: str, time_s: float, utc: str) -> None:
        """Set every good reading aside, and let all steps that rest on readings be done again."""
        kinds = {row["id"]: row["kind"] for row in self._db.execute("SELECT id, kind FROM steps")}
        again = {
            step: state.attempt
            for step, state in self.states().items()
            if state.state == "done" and KINDS[kinds[step]].rests_on_readings
        }
        with self._transaction():
            self._db.execute(
                f"UPDATE rows SET status = 'invalidated', why = ? WHERE {_GOOD_READING}", (why,)
            )
            for step, attempt in again.items():
                self._log(step, "failed", attempt, time_s, utc, {"what": why})

    # notes

    def note(self, kind: str, text: str, time_s: float, utc: str) -> None:
        """Write down an alarm, an answer, a remark."""
        self._db.execute(
            "INSERT INTO notes (time_s, utc, kind, text) VALUES (?, ?, ?, ?)",
            (time_s, utc, kind, text),
        )

    def notes(self) -> list[tuple[float, str, str]]:
        """Time in s, kind and text of every note."""
        rows = self._db.execute("SELECT time_s, kind, text FROM notes ORDER BY seq")
        return [(row["time_s"], row["kind"], row["text"]) for row in rows]

    def noted(self, after: int = 0) -> list[tuple[str, float, str, str]]:
        """UTC, time in s, kind and text of every note after the first so many."""
        rows = self._db.execute(
            "SELECT utc, time_s, kind, text FROM notes WHERE seq > ? ORDER BY seq", (after,)
        )
        return [(row["utc"], row["time_s"], row["kind"], row["text"]) for row in rows]


def _summed(table: str, values: dict[str, Any]) -> dict[str, Any]:
    return {**values, "sum": checksum(table, values)}
