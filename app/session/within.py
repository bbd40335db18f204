"""Where a run lies: the files that make a folder a session's."""

from pathlib import Path

PLAN, JOURNAL = "plan.json", "journal.sqlite"


def session_of(run: str) -> Path | None:
    """The session that left a run, if the run still lies in it."""
    session = Path(run).parent
    return session if (session / JOURNAL).is_file() and (session / PLAN).is_file() else None
