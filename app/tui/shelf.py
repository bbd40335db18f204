"""The sessions on the disk: which are finished, which can be gone on with, which runs there are."""

from pathlib import Path

from app.session.journal import Journal
from calib.errors import BadInput

MOST = 50
"""How many of the newest sessions are looked at."""


def sessions(root: Path) -> list[tuple[Path, bool]]:
    """Folders of the sessions under ``root``, newest first, and whether each is finished."""
    folders = sorted((path.parent for path in root.glob("*/journal.sqlite")), reverse=True)
    return [(folder, _finished(folder)) for folder in folders[:MOST]]


def _finished(folder: Path) -> bool:
    try:
        journal = Journal(folder / "journal.sqlite", read_only=True)
    except BadInput:
        return True  # not a journal that can be gone on with
    try:
        return journal.meta("finished_utc") is not None
    finally:
        journal.close()


def unfinished(root: Path) -> list[Path]:
    """Sessions that can be gone on with.

    Check poses of a write-back are not among them: what they were to check has been put back.
    """
    return [folder for folder, done in sessions(root) if not done and _kind(folder) != "check"]


def runs_under(root: Path) -> list[Path]:
    """Run folders of finished measurements, newest first."""
    return [
        folder / "run" for folder, done in sessions(root) if done and _kind(folder) == "measure"
    ]


def finished_verifications(root: Path) -> list[Path]:
    """Folders of finished verifications, newest first."""
    return [folder for folder, done in sessions(root) if done and _kind(folder) == "verify"]


def _kind(folder: Path) -> str:
    """``20261122-080937-hexapod-verify-2`` is a ``verify`` session."""
    return folder.name.rstrip("-0123456789").rpartition("-")[2]
