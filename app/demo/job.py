"""The seven steps of the job, each with the functions that its verb uses."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.analysis import load_rows
from app.files.fits import read_fit
from app.files.models import write_model
from app.files.pose_table import Pose
from app.files.poses import full_poses, nest_matrix, render_design
from app.files.site import Site, load_site
from app.report.build import Asked, write_report
from app.session import events as ev
from app.session.plans import PlanOptions, measure_plan, order_for
from app.session.session import Session
from app.session.station import Station
from app.verification import Verification, judge_session, verification_plan
from app.writeback.gates import Gates
from app.writeback.procedure import WriteBack
from calib.defaults import POSES_FROM
from calib.identify import fit
from calib.model import Model
from calib.poses import verification_poses
from calib.poses.design import design_poses
from calib.poses.readings import NestReadings

STEPS = (
    ("before", "verify: where does the machine really go?"),
    ("poses", "poses: choose where to measure"),
    ("measure", "measure: three SMRs at every pose"),
    ("fit", "fit: identify the parameters"),
    ("apply", "apply: snapshot, write, read back, check, store"),
    ("after", "verify: the same poses again"),
    ("report", "report: the calibration record"),
)
READING_SIGMA_MM = 0.004


@dataclass(frozen=True)
class Watcher:
    """Who is told how the demo goes: a step begins, is some part done, ends with one line."""

    begins: Callable[[str], None]
    part: Callable[[str, float], None]
    ends: Callable[[str, str], None]


@dataclass(frozen=True)
class Outcome:
    """What the demo leaves: both verifications and the report."""

    before: Verification
    after: Verification
    report: Path
    folder: Path


class Demo:
    """One demonstration in a folder of its own.

    Parameters
    ----------
    folder : Path
    count : int
        Poses to measure.
    seed : int
        Seed of the choice of poses.
    watcher : Watcher
    every : int
        Of the verification poses each so-manieth is gone to.
    add : sequence of str
        Effects in the model.
    """

    def __init__(
        self,
        folder: Path,
        count: int,
        seed: int,
        watcher: Watcher,
        every: int = 1,
        add: Sequence[str] = (),
    ) -> None:
        self.folder, self.count, self.seed, self.watcher = folder, count, seed, watcher
        self.every, self.add = every, tuple(add)
        self.running: Session | WriteBack | None = None

    async def stop(self) -> None:
        """Stop whatever moves at this moment; :meth:`run` then raises StoppedByOperator."""
        if self.running is not None:
            await self.running.stop()

    async def run(self, site_file: Path) -> Outcome:
        """Do the whole job on the station of a site file."""
        site = load_site(site_file)
        before = await self._verify(site, "before")
        poses = self._poses(site)
        run_folder = await self._measure(site, poses)
        model = self._fit(run_folder)
        await self._apply(site, model)
        after = await self._verify(site, "after")
        report = self._report(run_folder)
        return Outcome(before, after, report, self.folder)

    async def _session(self, step: str, session: Session) -> Path:
        leave = session.observers.watch(self._progress(step))
        self.running = session
        try:
            await session.connect()
            return (await session.run()).run_folder
        finally:
            self.running = None
            leave()
            await session.close()

    def _progress(self, step: str) -> Callable[[ev.Event], None]:
        def hear(event: ev.Event) -> None:
            if isinstance(event, ev.Progress) and event.total:
                self.watcher.part(step, event.done / event.total)

        return hear

    async def _verify(self, site: Site, step: str) -> Verification:
        self.watcher.begins(step)
        poses = dict(list(verification_poses(site.machine).by_label.items())[:: self.every])
        plan = verification_plan(site, poses, truth=True)
        session = Session.create(site, plan, self.folder / "sessions", unattended=True)
        await self._session(step, session)
        found = judge_session(session.folder)
        saved = {**found.to_json(), "session": str(session.folder)}
        (self.folder / f"{step}.json").write_text(json.dumps(saved, indent=1), encoding="utf-8")
        seen = found.measured
        self.watcher.ends(
            step,
            f"{len(found.labels)} poses: peak {seen.position_peak_um:.1f} um, "
            f"{seen.orientation_peak_deg:.4f} deg as measured",
        )
        return found

    def _poses(self, site: Site) -> dict[str, Pose]:
        self.watcher.begins("poses")
        readings = NestReadings(
            nest_matrix(site.platform_nests), READING_SIGMA_MM, nest_matrix(site.base_nests)
        )
        design = design_poses(
            site.machine,
            readings,
            self.count,
            np.random.default_rng(self.seed),
            criterion="I",
            priors=True,
            candidates=POSES_FROM,
            counts=[self.count],
        )
        text = render_design(design, self.seed, f"pkmcal demo --poses {self.count}")
        (self.folder / "poses.toml").write_text(text, encoding="utf-8")
        self.watcher.ends(
            "poses",
            f"{self.count} of {POSES_FROM} reachable poses; predicted "
            f"{design.accuracy.position_um:.1f} um RMS at fresh ones",
        )
        return full_poses(design.labels, design.pose_set)

    async def _measure(self, site: Site, poses: dict[str, Pose]) -> Path:
        self.watcher.begins("measure")
        plan = measure_plan(
            site, poses, PlanOptions(order=order_for(site), title="demo: the measured poses")
        )
        session = Session.create(site, plan, self.folder / "sessions", unattended=True)
        run_folder = await self._session("measure", session)
        self.watcher.ends("measure", f"{len(poses)} poses x {len(site.platform_nests)} nests")
        return run_folder

    def _fit(self, run_folder: Path) -> Path:
        self.watcher.begins("fit")
        found = fit(Model(*load_rows((str(run_folder),), self.add)))
        path = self.folder / "model.toml"
        write_model(path, found)
        self.watcher.ends(
            "fit",
            f"{found.readings} readings, RMS {found.rms_mm * 1e3:.2f} um (noise floor "
            f"{found.noise_floor_mm * 1e3:.2f} um), chi-square per dof {found.chi2_per_dof:.2f}",
        )
        return path

    async def _apply(self, site: Site, model: Path) -> None:
        self.watcher.begins("apply")

        async def confirm(*_: Any) -> bool:
            return True  # every gate has passed, and the machine is a mock

        station = Station(site)
        job = WriteBack(
            station,
            read_fit(model),
            Gates.with_limits({}),
            self.folder / "sessions",
            confirm,
            unattended=True,
        )
        leave = station.observers.watch(self._progress("apply"))
        self.running = job
        try:
            await station.connect()
            applied = await job.run()
        finally:
            self.running = None
            leave()
            await station.close()
        changed = sum(c.old != c.new for c in applied.proposal.changes)
        self.watcher.ends(
            "apply",
            f"{changed} parameters stored; pkmcal undo --to {applied.snapshot.number} takes "
            "them back",
        )

    def _report(self, run_folder: Path) -> Path:
        self.watcher.begins("report")
        path = self.folder / "report.html"
        asked = Asked(
            add=self.add,
            before=self.folder / "before.json",
            after=self.folder / "after.json",
            title="Demonstration: a mock calibrated",
        )
        write_report((str(run_folder),), asked, (path, path.with_suffix(".pdf")))
        self.watcher.ends("report", str(path))
        return path
