"""What lies in the sessions' folder, and what happened in a session, as answers."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from app.jobs.chosen_runs import File
from app.jobs.record import Record, Report
from app.session.facts import facts_of, sessions_under
from app.session.folder import latest_session
from app.session.happenings import happenings


@dataclass(frozen=True, kw_only=True)
class SessionEntry(Record):
    """A session: ``state`` is finished, begun (pkmcal resume goes on with it) or broken."""

    folder: str
    state: str
    purpose: str
    machine: str
    serial: str
    title: str
    begun_utc: str
    finished_utc: str
    poses: int
    readings: int
    done: int
    steps: int


@dataclass(frozen=True, kw_only=True)
class SessionsReport(Report):
    """The sessions in a folder, the newest first (``pkm-sessions/1``)."""

    FORMAT: ClassVar[str] = "pkm-sessions/1"
    sessions: tuple[SessionEntry, ...]


@dataclass(frozen=True, kw_only=True)
class HappeningEntry(Record):
    """What happened: clock time (UTC), machine time in s, the kind of entry, its words."""

    utc: str
    time_s: float
    kind: str
    text: str


@dataclass(frozen=True, kw_only=True)
class LogReport(Report):
    """All that a session's journal tells (``pkm-log/1``)."""

    FORMAT: ClassVar[str] = "pkm-log/1"
    session: SessionEntry
    entries: tuple[HappeningEntry, ...]


def list_sessions(folder: File = "sessions") -> SessionsReport:
    """List the sessions in a folder, the newest first: what each was and how far it came.

    Parameters
    ----------
    folder : path
        Where the sessions are.

    Returns
    -------
    SessionsReport
        Empty where there is no session.

    Raises
    ------
    BadInput
        Never for a session that cannot be read: that one is ``broken``.

    Examples
    --------
    >>> [one.title for one in pkmcal.list_sessions().sessions]               # doctest: +SKIP
    """
    found = [_entry(facts) for facts in sessions_under(Path(folder))]
    return SessionsReport.of({"format": SessionsReport.FORMAT, "sessions": found})


def session_log(session: File | None = None, *, folder: File = "sessions") -> LogReport:
    """Read what happened in a session, by the clock: steps, alarms, questions and answers.

    Parameters
    ----------
    session : path, optional
        Its folder; the newest one in ``folder`` if None.
    folder : path
        Where the sessions are.

    Returns
    -------
    LogReport

    Raises
    ------
    BadInput
        If there is no session, or its files cannot be read.

    Examples
    --------
    >>> for one in pkmcal.session_log().entries:                             # doctest: +SKIP
    ...     print(one.utc, one.kind, one.text)
    """
    chosen = latest_session(Path(folder)) if session is None else Path(session)
    entries = [vars(one) for one in happenings(chosen)]
    said = {"format": LogReport.FORMAT, "session": _entry(facts_of(chosen)), "entries": entries}
    return LogReport.of(said)


def _entry(facts: object) -> dict[str, object]:
    return {**vars(facts), "folder": str(vars(facts)["folder"])}
