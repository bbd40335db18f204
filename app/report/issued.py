"""The records that were written, a line each beside the sessions: what, of which runs, where to."""

import contextlib
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from app.session.within import session_of

FILE = "records.jsonl"


def note_issued(number: str, runs: Sequence[str], outs: Sequence[Path]) -> None:
    """Add a line beside the sessions of the runs; runs elsewhere, and read-only media, have none.

    ``{"utc": ..., "number": ..., "sessions": [...], "files": [...]}``
    """
    sessions = [session for session in map(session_of, runs) if session is not None]
    if not sessions:
        return
    said = {
        "utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "number": number,
        "sessions": [session.name for session in sessions],
        "files": [str(out.resolve()) for out in outs],
    }
    with (
        contextlib.suppress(OSError),
        (sessions[-1].parent / FILE).open("a", encoding="utf-8", newline="\n") as file,
    ):
        file.write(json.dumps(said) + "\n")


def issued_for(root: Path, session: str) -> list[datetime]:
    """When records of a session's run were written; lines that cannot be read are passed over."""
    file = root / FILE
    if not file.is_file():
        return []
    found = []
    for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
        with contextlib.suppress(ValueError, TypeError, KeyError):
            said = json.loads(line)
            if session in said["sessions"]:
                found.append(datetime.fromisoformat(said["utc"]))
    return found
