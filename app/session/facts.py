"""The sessions on the disk: what each was, and how far it came."""

import json
import sqlite3
from dataclasses import dataclass
from pathlib import Path

from app.files.text import read_text
from app.session.journal import IDENTITIES, Journal
from app.session.within import JOURNAL, PLAN
from calib.errors import BadInput


@dataclass(frozen=True)
class SessionFacts:
    """One session: ``state`` is ``finished``, ``begun`` (it can be gone on with) or ``broken``.

    ``begun_utc`` and ``finished_utc`` are ISO 8601, "" where they did not come; ``done`` of
    ``steps`` steps.
    """

    folder: Path
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


def facts_of(folder: Path) -> SessionFacts:
    """Read what a session is; one whose files cannot be read is ``broken``."""
    try:
        plan = json.loads(read_text(folder / PLAN))
        journal = Journal(folder / JOURNAL, read_only=True, checked=False)
    except (BadInput, ValueError) as error:
        return SessionFacts(folder, "broken", "", "", "", str(error), "", "", 0, 0, 0, 0)
    try:
        finished = str(journal.meta("finished_utc", ""))
        return SessionFacts(
            folder=folder,
            state="finished" if finished else "begun",
            purpose=str(plan.get("purpose", "")),
            machine=str(plan.get("machine", "")),
            serial=str(journal.meta(IDENTITIES, {}).get("controller", {}).get("serial", "")),
            title=str(plan.get("title", "")),
            begun_utc=str(journal.meta("begun_utc", "")),
            finished_utc=finished,
            poses=len(plan.get("poses", {})),
            readings=journal.readings(),
            done=journal.ended(),
            steps=len(plan.get("steps", ())),
        )
    except (sqlite3.DatabaseError, ValueError) as error:
        return SessionFacts(folder, "broken", "", "", "", str(error), "", "", 0, 0, 0, 0)
    finally:
        journal.close()


def sessions_under(root: Path, most: int | None = None) -> list[SessionFacts]:
    """The sessions in a folder, the newest first; ``most`` limits how many are looked at."""
    folders = sorted((path.parent for path in root.glob(f"*/{JOURNAL}")), reverse=True)
    whole = [folder for folder in folders if not folder.name.startswith("draft-")]
    return [facts_of(folder) for folder in whole[:most]]
