"""What a record rests on: the runs, verifications before and after, and what was written.

Everything is read from sessions and files that anyone can read again.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.files.site import Site
from app.files.text import read_text
from app.history.store import Entry
from app.session.folder import RUN, read_folder
from app.session.journal import IDENTITIES, Journal
from app.session.plan import Plan
from app.session.taken import Taken, taken_in
from app.session.within import JOURNAL, PLAN, session_of
from app.verification import FORMAT, judge_session
from calib.arrays import Array
from calib.errors import BadInput


@dataclass(frozen=True)
class Checked:
    """A verification (``pkm-verification/1``), the poses that it visited, and how it was taken."""

    answer: Mapping[str, Any]
    poses: Mapping[str, tuple[float, ...]]
    taken: Taken

    @property
    def labels(self) -> list[str]:
        """Poses that were judged, in order."""
        return [row["pose"] for row in self.answer["errors"]]

    def errors(self) -> tuple[Array, Array]:
        """Position error (um) and rotation angle (mdeg) of every pose, (N,) each."""
        rows = self.answer["errors"]
        position = np.linalg.norm([row["position_um"] for row in rows], axis=1)
        return position, 1e3 * np.linalg.norm([row["rotation_deg"] for row in rows], axis=1)

    def expanded(self) -> tuple[Array, Array] | None:
        """Expanded uncertainty (k = 2) of these errors; None where it is not known."""
        rows = self.answer["errors"]
        if any(row.get("position_u_um") is None for row in rows):
            return None
        position = np.array([row["position_u_um"] for row in rows])
        return position, 1e3 * np.array([row["rotation_u_deg"] for row in rows])

    def positions(self) -> Array:
        """Commanded platform positions (3, N) in mm, in the order of :meth:`errors`."""
        return np.array([self.poses[label][:3] for label in self.labels]).T


@dataclass(frozen=True)
class Sources:
    """All that a record rests on; what is not there is None or empty."""

    runs: Sequence[str]
    measured: Sequence[Taken]
    site: Site | None = None
    before: Checked | None = None
    after: Checked | None = None
    applied: Entry | None = None


def read_checked(path: Path) -> Checked:
    """Read a verification: what ``verify --save`` kept, or the folder of its session.

    Raises
    ------
    BadInput
        If it is neither.
    """
    if path.is_dir():
        return _judged(path, None)
    try:
        found = json.loads(read_text(path))
        if found["format"] != FORMAT:
            raise ValueError(f"format {found['format']!r}")
        session = Path(found["session"])
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a saved verification ({error})", place=str(path), remedy="pkmcal verify --save"
        ) from error
    return _judged(session, found)


def _judged(session: Path, found: Mapping[str, Any] | None) -> Checked:
    """A verification with what its session tells; judged again if it is of an older version."""
    there = (session / JOURNAL).is_file()
    if found is None or (there and "axes" not in found):
        found = {**judge_session(session).to_json(), "session": str(session)}
    plan = Plan.from_json(read_text(session / PLAN), str(session / PLAN))
    return Checked(found, plan.poses, taken_in(session) if there else Taken())


def verifications_beside(runs: Sequence[str]) -> tuple[Path | None, Path | None]:
    """Finished verifications among the sessions beside the runs: the last before, the last after.

    Those of the same controller count; check poses of a write-back do not.
    """
    sessions = [session for session in map(session_of, runs) if session is not None]
    if not sessions:
        return None, None
    began = min(_meta(session, "begun_utc") for session in sessions)
    ended = max(_meta(session, "finished_utc") for session in sessions)
    serial = _serial(sessions[0])
    before: dict[str, Path] = {}
    after: dict[str, Path] = {}
    for journal in sessions[0].parent.glob(f"*-verify*/{JOURNAL}"):
        begun, done = (_meta(journal.parent, key) for key in ("begun_utc", "finished_utc"))
        if not done or _serial(journal.parent) != serial:
            continue
        if done <= began:
            before[begun] = journal.parent
        elif ended and begun >= ended:
            after[begun] = journal.parent
    return (
        before[max(before)] if before else None,
        after[max(after)] if after else None,
    )


def run_before(session: Path) -> Path | None:
    """The run of the last finished measurement beside a session, of the same controller."""
    serial = _serial(session)
    runs = {
        _meta(one.parent, "finished_utc"): one.parent / RUN
        for one in session.parent.glob(f"*-measure*/{JOURNAL}")
        if _serial(one.parent) == serial
    }
    runs.pop("", None)
    return runs[max(runs)] if runs else None


def _meta(session: Path, key: str) -> str:
    journal = Journal(session / JOURNAL, read_only=True)
    try:
        return str(journal.meta(key, ""))
    finally:
        journal.close()


def _serial(session: Path) -> str:
    journal = Journal(session / JOURNAL, read_only=True)
    try:
        return str(journal.meta(IDENTITIES, {}).get("controller", {}).get("serial", ""))
    finally:
        journal.close()


def site_of_session(session: Path) -> Site:
    """The site as it was when the session began."""
    return read_folder(session)[0]
