"""From the journal to a run on disk: ``run.toml`` and ``points.csv`` (docs/run-format.md)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from app.files.runs import write_run
from app.files.site import Site
from app.files.site_gauge import GaugeSite
from app.files.text import read_text
from app.session.gauge_export import sensed_rows
from app.session.journal import FRAME, IDENTITIES, PARAMETERS, Journal
from app.session.plan import Plan
from app.session.rows import Row
from calib.arrays import Array
from calib.runs import Digits, Header, Run, covariance_matrices
from calib.runs.sensing import Setup

DIGITS = Digits(
    time=".3f", q=".9f", position=".7f", sigma=".8f", covariance=".6e", channel=".6g",
    channels={"cycle": ".0f"},
)  # fmt: skip
"""A tenth of a nanometre, far below what a tracker tells."""

MACHINE = "machine.toml"
"""A lab's own machine file goes with the run, so that the run can be read elsewhere."""
_SAME = 1e-9
_NOTHING = (np.nan,) * 6


def export_run(site: Site, plan: Plan, journal: Journal, folder: Path) -> Path:
    """Write the run of a session; what is there from an earlier export is replaced.

    Returns the run's folder. Good readings only, in the order in which they were taken; a move
    after which nothing was read stays as a row without a reading, since the next direction of
    approach depends on it.
    """
    header = _header(site, plan, journal)
    if header.machine == MACHINE:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / MACHINE).write_text(read_text(Path(site.machine.source)), encoding="utf-8")
    run = run_of(journal.rows(), header, len(site.machine.actuators))
    write_run(folder, run, DIGITS, replace=True)
    return folder


def _header(site: Site, plan: Plan, journal: Journal) -> Header:
    known = site.machine.parameter_index
    held: Mapping[str, float] = journal.meta(PARAMETERS, {})
    serials = {role: who["serial"] for role, who in journal.meta(IDENTITIES, {}).items()}
    tracker = {}
    if site.gauge is None:
        tracker = {"model": site.tracker.model, "reflector": site.tracker.reflector}
        if serials.get("tracker"):
            tracker["serial"] = serials["tracker"]
    if site.controller.hosted:  # q is what the machine was sent: nothing was done beyond it
        held = {}
    return Header(
        machine=MACHINE if site.machine_name.endswith(".toml") else site.machine_name,
        title=plan.title,
        tracker=tracker,
        platform_nests={name: np.array(place) for name, place in site.platform_nests.items()},
        base_nests={name: np.array(place) for name, place in site.base_nests.items()},
        controller_serial=serials.get("controller", ""),
        controller_parameters={name: v for name, v in held.items() if name in known},
        compensation={name: v for name, v in held.items() if name not in known and v != 0.0},
        controller_frame=journal.meta(FRAME, {}),
        load=site.load,
        setup=None if site.gauge is None else _setup(site, site.gauge),
    )


def _setup(site: Site, gauge: GaugeSite) -> Setup:
    """The gauge as the run's instrument, with what the site says of planes and nests."""
    known = site.setup or Setup()
    return Setup({gauge.name: gauge.instrument}, known.planes, known.nests)


def run_of(rows: Sequence[Row], header: Header, actuators: int) -> Run:
    """Rows of a journal as a run."""
    kept = [row for i, row in enumerate(rows) if row.kind == "reading" or not _read_after(rows, i)]
    six = np.array([row.covariance or _NOTHING for row in kept]).reshape(-1, 6).T
    held = kept if header.setup is not None else []
    sensing, position, covariance = sensed_rows(held, header.setup) if held else (None, None, None)
    return Run(
        header=header,
        source="journal",
        line=np.arange(len(kept)) + 2,
        time_s=np.maximum.accumulate([row.time_s for row in kept]),
        pose=tuple(row.pose for row in kept),
        nest=tuple(row.nest for row in kept),
        q=np.array([row.q for row in kept]).reshape(-1, actuators).T,
        measured=np.array([row.kind == "reading" for row in kept], dtype=bool),
        position=np.array([row.xyz or _NOTHING[:3] for row in kept]).reshape(-1, 3).T
        if position is None
        else position,
        covariance=covariance_matrices(six) if covariance is None else covariance,
        channels=_channels(kept),
        left_aside={},
        sensing=sensing,
    )


def _channels(kept: Sequence[Row]) -> dict[str, Array]:
    """Delay, cycle where there is any, and every other channel in alphabetical order."""
    held: list[Mapping[str, float | None]] = [
        {"delay_s": row.delay_s, "cycle": row.cycle, **row.channels} for row in kept
    ]
    cycles = any(row.cycle is not None for row in kept)
    others = sorted({name for row in kept for name in row.channels})
    names = ["delay_s", *(["cycle"] if cycles else []), *others]
    return {name: np.array([row.get(name) for row in held], dtype=float) for name in names}


def _read_after(rows: Sequence[Row], index: int) -> bool:
    """Whether something was read where this move led to, before the next move."""
    for row in rows[index + 1 :]:
        if row.kind == "move":
            return False
        if all(abs(a - b) < _SAME for a, b in zip(row.q, rows[index].q, strict=True)):
            return True
    return False
