"""A disk that is full, or gone, in the middle of a session: a fault like any other, in words."""

import errno
import sqlite3
import sys
from pathlib import Path

from app.files.site import Site
from app.session.export import export_run
from app.session.folder import RUN
from app.session.journal import Journal
from app.session.plan import Plan
from drivers.errors import DeviceError

UNWRITTEN = (sqlite3.Error, OSError)
"""What the journal or the disk raises; drivers say in words what their links raise."""


def unwritten(error: Exception, folder: Path) -> DeviceError:
    """Say that a session cannot be written any more, and how it goes on."""
    why = getattr(error, "strerror", None) or str(error)
    mend = "Let this user write there" if _forbidden(error) else "Make room on it"
    return DeviceError(
        f"the session cannot be written: {why}",
        device="disk",
        remedy=f"{mend}, then: pkmcal resume {folder}; what was read until now is kept",
    )


def _forbidden(error: Exception) -> bool:
    """Whether a disk, a folder or a file may only be read."""
    if isinstance(error, OSError):
        return error.errno in (errno.EACCES, errno.EPERM, errno.EROFS)
    return "readonly" in str(error)


def export_at_end(site: Site, plan: Plan, journal: Journal, folder: Path) -> None:
    """Write the run, also of a session that ended early: what was read is of use already.

    Where the session ends on a fault, that nothing can be written takes nothing of that fault.

    Raises
    ------
    DeviceError
        If a session that went well cannot be written.
    """
    ending = sys.exc_info()[1]
    try:
        if journal.readings():
            export_run(site, plan, journal, folder / RUN)
    except UNWRITTEN as error:
        if ending is None:
            raise unwritten(error, folder) from error
