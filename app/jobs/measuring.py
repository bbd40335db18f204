"""Measure poses, and go on with a session that ended early."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from app.files.pose_table import Pose
from app.files.poses import read_any_poses, read_marks
from app.files.site import Site
from app.jobs.chosen_runs import File, path_of
from app.jobs.record import Report
from app.session.folder import latest_session
from app.session.plans import Order, PlanOptions, measure_plan, order_for
from app.session.session import Outcome, Session
from app.session.station import Station
from calib.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class SessionReport(Report):
    """A finished session (``pkm-session/1``): its folder, the run's folder, how many readings."""

    FORMAT: ClassVar[str] = "pkm-session/1"
    session: str
    run: str
    readings: int


def begin_measuring(
    site: Site,
    poses: File | Mapping[str, Pose],
    *,
    folder: Path,
    order: Order | None = None,
    reference_every: int = 10,
    cycles: int = 1,
    warm_up: bool = True,
    title: str = "",
    pairs: Sequence[tuple[str, str]] = (),
    station: Station | None = None,
    unattended: bool,
) -> Session:
    """Make a session that visits poses; ``order`` is by the SMRs at hand if None.

    ``pairs`` of poses, with a gauge: marks are left at them, and measured between.

    Raises
    ------
    BadInput
        For poses that cannot be read, and fewer SMRs than the order needs.
    """
    options = PlanOptions(
        order=order or order_for(site),
        reference_every=reference_every,
        cycles=cycles,
        warm_up=warm_up,
        title=title,
        marks=marks_of(pairs, poses, site),
    )
    plan = measure_plan(site, read_if_file(poses, site), options)
    return Session.create(site, plan, folder, station=station, unattended=unattended)


def begin_again(
    session: File | None, *, folder: Path, station: Station | None = None, unattended: bool
) -> Session:
    """Reopen a session that ended early, or the latest one in ``folder``; raises BadInput."""
    chosen = path_of(session) or latest_session(folder)
    return Session.reopen(chosen, station=station, unattended=unattended)


def marks_of(
    pairs: Sequence[tuple[str, str]], poses: File | Mapping[str, Pose], site: Site
) -> tuple[tuple[str, str], ...]:
    """Pairs that are named; else, where a gauge reads distances and has no nests, the file's."""
    gauge = site.gauge
    if (
        pairs
        or gauge is None
        or gauge.reads != "distance"
        or not isinstance(poses, str | os.PathLike)
    ):
        return tuple(pairs)
    return read_marks(Path(poses), site.machine) if not gauge.pairs else ()


def read_if_file(poses: File | Mapping[str, Pose], site: Site) -> Mapping[str, Pose]:
    """Label -> pose as it is given, or from a poses file."""
    if isinstance(poses, str | os.PathLike):
        return read_any_poses(Path(poses), site.machine)
    return poses


def session_report(outcome: Outcome) -> SessionReport:
    """What a finished session answers."""
    said = {
        "format": "pkm-session/1",
        "session": str(outcome.folder),
        "run": str(outcome.run_folder),
        "readings": outcome.readings,
    }
    return SessionReport.of(said)


def mark_pair(text: str) -> tuple[str, str]:
    """Two labels from ``A:B``; raises BadInput."""
    first, between, second = text.partition(":")
    if not between or not first or not second or first == second:
        raise BadInput(f'"{text}" names no two poses', place="--pair", remedy="Write --pair A:B")
    return first, second
