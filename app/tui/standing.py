"""How far the calibration of a machine had come when the program was left, read from the disk."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from app.history.store import History
from app.report.issued import issued_for
from app.session.facts import SessionFacts, sessions_under

MOST = 200
"""How many of the newest sessions are looked at."""


@dataclass(frozen=True)
class Standing:
    """What was done: ``done`` as :class:`app.tui.course.Course` holds it, folders of sessions.

    ``run`` is the run that was measured last, ``found`` and ``left`` are verifications, before and
    after what it led to was written. A calibration whose record is written is over: then only
    ``left`` is told, to stand beside what is found the next time.
    """

    done: frozenset[str] = frozenset()
    run: Path | None = None
    found: Path | None = None
    left: Path | None = None


def standing_of(root: Path, serial: str, in_use: int | None) -> Standing:
    """Read sessions, history and records of one controller; ``in_use`` is the set that it holds.

    Raises
    ------
    BadInput
        If the history cannot be read.
    """
    sessions = [
        one for one in sessions_under(root, MOST) if one.serial == serial and one.finished_utc
    ]
    sessions.sort(key=_ended)
    measured = next((one for one in reversed(sessions) if one.purpose == "measure"), None)
    checks = [one for one in sessions if one.purpose == "verify"]
    written = [entry for entry in History(root).entries("applied") if entry.serial == serial]
    since = _ended(measured) if measured is not None else None
    kept = [
        entry.when
        for entry in written
        if since is not None and entry.when > since and entry.said.get("set") == in_use
    ]
    earlier = [entry.when for entry in written if entry.when not in kept]
    begun = max(earlier, default=None)
    applied = kept[-1] if kept else None
    found = [
        one.folder
        for one in checks
        if (begun is None or _ended(one) > begun) and (applied is None or _ended(one) < applied)
    ]
    left = [one.folder for one in checks if applied is not None and _ended(one) > applied]
    record = (
        [when for when in issued_for(root, measured.folder.name) if when >= applied]
        if measured is not None and applied is not None
        else []
    )
    if left and record:
        return Standing(left=left[-1])
    steps = {"found": found, "applied": applied, "left": left, "record": record}
    return Standing(
        frozenset(name for name, there in steps.items() if there),
        measured.folder / "run" if measured is not None else None,
        found[-1] if found else None,
        left[-1] if left else None,
    )


def _ended(facts: SessionFacts) -> datetime:
    return datetime.fromisoformat(facts.finished_utc)
