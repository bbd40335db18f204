"""From files to a calibration record, and on to the disk."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from app.analysis import load_rows, masked_rows
from app.files.fits import read_fit
from app.files.site import Site
from app.files.staircase import Way
from app.history.store import Entry, History
from app.noisy import noisy
from app.report.accuracy import Tolerance
from app.report.html import html_of
from app.report.issued import note_issued
from app.report.page import Page
from app.report.pdf import pdf_of
from app.report.record import record_page
from app.report.sources import (
    Checked,
    Sources,
    read_checked,
    site_of_session,
    verifications_beside,
)
from app.session.taken import Taken, spans, taken_in
from app.session.within import session_of
from calib.errors import BadInput
from calib.identify import Fit, fit_report
from calib.identify.staged import fit_effects
from calib.runs import Run

TITLE = "Calibration record"


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a record is asked to hold; what is empty is taken from beside the runs.

    Attributes
    ----------
    add, model
        Effects in the model, as for ``pkmcal fit``; a model file also tells how it was found.
    mask : tuple of str
        Lines of readings that are left out, as for ``pkmcal fit``.
    before, after : Path, optional
        What ``verify --save`` kept, or the folder of a verification.
    site : Site, optional
        Whose ``[record]`` says who and what; that of the run's session if None.
    tolerance : Tolerance
        In place of the site's.
    title, number : str
    """

    add: tuple[str, ...] = ()
    model: Path | None = None
    mask: tuple[str, ...] = ()
    before: Path | None = None
    after: Path | None = None
    site: Site | None = None
    tolerance: Tolerance = field(default_factory=Tolerance)
    title: str = ""
    number: str = ""


def write_report(runs: tuple[str, ...], asked: Asked, outs: Sequence[Path]) -> None:
    """Fit the runs once more and write the record; ``outs`` end in ``.html`` or ``.pdf``.

    Raises
    ------
    BadInput
        For runs, models, verifications and templates that cannot be used, and files that cannot
        be written.
    """
    for out in outs:
        if out.suffix.lower() not in (".html", ".htm", ".pdf"):
            raise BadInput("neither .html nor .pdf", place=str(out), remedy="Name another --out")
    page, site = record_of_runs(runs, asked)
    details = site.record if site is not None else None
    for out in outs:
        if out.suffix.lower() == ".pdf":
            content = pdf_of(page, details.pdf_template if details else "")
        else:
            content = html_of(page, details.html_template if details else "").encode()
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            out.write_bytes(content)
        except OSError as error:
            raise BadInput(
                f"cannot write: {error}", place=str(out), remedy="Name another --out."
            ) from error
    note_issued(page.number, runs, outs)


def record_of_runs(runs: tuple[str, ...], asked: Asked) -> tuple[Page, Site | None]:
    """Fit the runs once more and make the record, with the site whose people it names."""
    rows, effects = load_rows(runs, asked.add, asked.model)
    found = noisy(fit_effects(rows, effects, masked_rows(rows, asked.mask)), asked.model)
    sources = _sources(runs, asked, found)
    way = read_fit(asked.model).way if asked.model is not None else Way()
    now = datetime.now(UTC)
    page = record_page(
        found,
        fit_report(found),
        sources,
        tolerance=_tolerance(asked.tolerance, sources.site),
        way=way,
        title=asked.title or TITLE,
        number=asked.number or _number(sources, found, now),
        issued=f"{now:%Y-%m-%d}",
        made_by=f"Made by pkmcal {version('pkmcal')}, {now:%Y-%m-%d %H:%M} UTC, from "
        f"{', '.join(runs)}.",
    )
    return page, sources.site


def _sources(runs: tuple[str, ...], asked: Asked, found: Fit) -> Sources:
    """Everything beside the runs that the record rests on."""
    sessions = [session for session in map(session_of, runs) if session is not None]
    beside: tuple[Path | None, Path | None] = (None, None)
    if asked.before is None and asked.after is None:
        beside = verifications_beside(runs)
    before, after = asked.before or beside[0], asked.after or beside[1]
    site = asked.site
    if site is None and sessions:
        site = site_of_session(sessions[-1])
    return Sources(
        runs=runs,
        measured=[_taken(run, one) for run, one in zip(runs, found.model.rows.runs, strict=True)],
        site=site,
        before=_checked(before),
        after=_checked(after),
        applied=_applied(runs, sessions),
    )


def _checked(path: Path | None) -> Checked | None:
    return None if path is None else read_checked(path)


def _taken(name: str, run: Run) -> Taken:
    """How a run was taken: by its session, or as far as the run itself tells."""
    session = session_of(name)
    if session is not None:
        return taken_in(session)
    read = np.asarray(run.measured)
    channels = {n: [v[read]] for n, v in run.channels.items() if n not in ("delay_s", "cycle")}
    return Taken(readings=int(read.sum()), channels=spans(channels))


def _applied(runs: tuple[str, ...], sessions: Sequence[Path]) -> Entry | None:
    """The last set that was written from these runs, by the history beside their sessions."""
    wanted = {_place(run) for run in runs}
    found = [
        entry
        for root in dict.fromkeys(session.parent for session in sessions)
        for entry in History(root).entries("applied")
        if wanted & {_place(str(Path(points).parent)) for points in entry.said["runs"]}
    ]
    return max(found, key=lambda entry: entry.utc) if found else None


def _place(run: str) -> tuple[str, ...]:
    """A run by the session that left it: the folder of all sessions may have been moved."""
    return Path(run).resolve().parts[-2:]


def _tolerance(asked: Tolerance, site: Site | None) -> Tolerance:
    if site is None:
        return asked
    return Tolerance(
        asked.um if asked.um is not None else site.record.tolerance_um,
        asked.mdeg if asked.mdeg is not None else site.record.tolerance_mdeg,
    )


def _number(sources: Sources, found: Fit, now: datetime) -> str:
    """A number of its own: when the run began, and the controller's serial number."""
    begun = sources.measured[0].begun
    stamp = datetime.fromisoformat(begun) if begun else now
    serial = found.model.rows.runs[0].header.controller_serial
    return f"{stamp:%Y%m%d-%H%M}{f'-{serial}' if serial else ''}"
