"""Measure the error that is left, over a grid of poses."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from app.defaults import REFERENCE_EVERY
from app.files.pose_table import Pose
from app.files.site import Site
from app.files.text import read_text
from app.jobs.chosen_runs import File
from app.jobs.measuring import read_if_file
from app.jobs.record import Record, Report
from app.session.journal import Journal
from app.session.session import Session
from app.session.station import Station
from app.session.within import JOURNAL
from app.verification import FORMAT, judge_session, verification_plan
from app.written import writable
from calib.errors import BadInput
from calib.poses import verification_poses

VERDICT = "verification.json"
"""The answer, in the folder of its session."""
_ASKED = "verdict"
"""What the journal remembers: the earlier verification, and where to keep the answer."""


@dataclass(frozen=True, kw_only=True)
class ErrorsEntry(Record):
    """Errors over all poses: norm of the position error, um; rotation angle, deg."""

    position_peak_um: float
    position_std_um: float
    position_rms_um: float
    orientation_peak_deg: float
    orientation_std_deg: float
    orientation_rms_deg: float


@dataclass(frozen=True, kw_only=True)
class PeaksEntry(Record):
    """Largest errors over all poses."""

    position_peak_um: float
    orientation_peak_deg: float


@dataclass(frozen=True, kw_only=True)
class PoseErrorEntry(Record):
    """Error of one pose in base axes: (3,) um and (3,) deg.

    ``position_u_um`` and ``rotation_u_deg``: expanded uncertainties (k = 2), worst direction.
    """

    pose: str
    position_um: tuple[float, ...]
    rotation_deg: tuple[float, ...]
    position_u_um: float | None
    rotation_u_deg: float | None


@dataclass(frozen=True, kw_only=True)
class ExpandedEntry(Record):
    """Expanded uncertainties (coverage factor ``k``) by what the tracker states of its readings."""

    k: float
    position_peak_um: float
    position_rms_um: float
    orientation_peak_deg: float
    orientation_rms_deg: float


@dataclass(frozen=True, kw_only=True)
class AxisEntry(Record):
    """Errors along, or about, one base axis over all poses, in ``unit``.

    ``largest`` with its sign; ``u_mean``: expanded uncertainty (k = 2) of the mean.
    """

    axis: str
    unit: str
    mean: float
    std: float
    largest: float
    u_mean: float | None


@dataclass(frozen=True, kw_only=True)
class BeforeEntry(Record):
    """The same of an earlier verification."""

    measured: ErrorsEntry
    truth: ErrorsEntry | None
    noise_alone: PeaksEntry


@dataclass(frozen=True, kw_only=True)
class VerificationReport(Report):
    """How far the machine is from where it was sent (``pkm-verification/1``).

    ``noise_alone``: the peaks that a perfect machine would show; ``truth``: on a mock, where asked
    for; ``paper``: Han et al. 2020, Table 6.
    """

    FORMAT: ClassVar[str] = FORMAT
    poses: int
    measured: ErrorsEntry
    noise_alone: PeaksEntry
    truth: ErrorsEntry | None
    paper: PeaksEntry
    expanded: ExpandedEntry | None
    axes: tuple[AxisEntry, ...]
    errors: tuple[PoseErrorEntry, ...]
    session: str
    before: BeforeEntry | None

    def save(self, file: File) -> None:
        """Keep the answer, for ``before=`` and the report."""
        Path(file).write_text(json.dumps(self.to_json(), indent=1), encoding="utf-8")


def begin_verifying(
    site: Site,
    poses: File | Mapping[str, Pose] | None = None,
    *,
    folder: Path,
    truth: bool = False,
    reference_every: int = REFERENCE_EVERY,
    before: Path | None = None,
    save: Path | None = None,
    station: Station | None = None,
    unattended: bool,
) -> Session:
    """Make a session that visits poses, the verification grid if None.

    ``before`` is an earlier verification to stand beside this one, ``save`` where the answer is to
    be kept: the session remembers both, so that it ends with them whenever it ends.

    Raises
    ------
    BadInput
        For poses and an earlier verification that cannot be read, and an answer that could not be
        kept.
    """
    _check(before, save)
    chosen = verification_poses(site.machine).by_label if poses is None else poses
    plan = verification_plan(
        site, read_if_file(chosen, site), truth=truth, reference_every=reference_every
    )
    session = Session.create(site, plan, folder, station=station, unattended=unattended)
    asked = {"before": before, "save": save, "folder": session.folder}
    session.journal.set_meta(_ASKED, {k: str(p.resolve()) for k, p in asked.items() if p})
    return session


def is_verification(session: Session) -> bool:
    """Whether a session is to end with a verdict."""
    return session.plan.purpose == "verify"


def check_conclusion(folder: Path) -> None:
    """See whether a session's verdict can be given and kept, before it goes on; raises BadInput."""
    _check(*_asked(folder))


def concluded(folder: Path) -> VerificationReport:
    """Judge a finished session as it was asked to be judged, and keep the answer.

    It is kept in the session's folder, and where :func:`begin_verifying` was told.

    Raises
    ------
    BadInput
        Where too little was read.
    """
    before, save = _asked(folder)
    report = verification_report(folder, read_before(before) if before else None)
    report.save(folder / VERDICT)
    if save:
        report.save(save)
    return report


def _check(before: Path | None, save: Path | None) -> None:
    if before:
        read_before(before)
    if save:
        writable(save)


def _asked(folder: Path) -> tuple[Path | None, Path | None]:
    """The earlier verification, and where the answer is to be kept.

    A session that was carried elsewhere keeps its answer in its own folder alone: what stands at
    that path on this computer is somebody else's.
    """
    journal = Journal(folder / JOURNAL, read_only=True)
    try:
        asked = journal.meta(_ASKED, {})
    finally:
        journal.close()
    before, save = (Path(asked[key]) if key in asked else None for key in ("before", "save"))
    at_home = asked.get("folder", str(folder.resolve())) == str(folder.resolve())
    return before, save if at_home else None


def verification_report(
    session: File, before: Mapping[str, Any] | None = None
) -> VerificationReport:
    """Judge a finished session from its folder, beside an earlier verification.

    Raises
    ------
    BadInput
        Where too little was read.
    """
    said = judge_session(Path(session)).to_json()
    said["session"] = str(session)
    said["before"] = before and {k: before[k] for k in ("measured", "truth", "noise_alone")}
    return VerificationReport.of(said)


def read_before(path: Path) -> dict[str, Any]:
    """Read an earlier verification; raises BadInput if the file holds none."""
    try:
        data: dict[str, Any] = json.loads(read_text(path))
        if data["format"] != FORMAT or "measured" not in data:
            raise ValueError("another format")
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a saved verification ({error})", place=str(path), remedy="pkmcal verify --save"
        ) from error
    return data
