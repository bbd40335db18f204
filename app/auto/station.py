"""Decisions carried out on a station: sessions that are journaled as every other, and the gates."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import numpy as np

from app.auto.aside import aside
from app.auto.autopilot import Seen
from app.auto.findings import fresh_poses
from app.files.fits import read_fit
from app.files.pose_table import Pose
from app.files.runs import read_run
from app.jobs.measuring import begin_measuring
from app.jobs.posing import choose_poses
from app.jobs.verifying import begin_verifying
from app.session.journal import Journal
from app.session.plans import warming_plan
from app.session.session import Outcome, Session
from app.session.station import Station
from app.session.within import JOURNAL
from app.verification import Verification, judge_session
from app.writeback.gates import Gates
from app.writeback.procedure import WriteBack
from calib.errors import BadInput

SURE_SIGMAS = 1.645
"""One-sided, 95 %."""
ROUND = 4
"""Of the fresh poses each so-manieth is on the round that a machine goes while it warms up."""


class StationLaboratory:
    """A station with its controller and tracker, connected when something is carried out.

    Parameters
    ----------
    station : Station
        Whoever made it closes it.
    folder : Path
        Where sessions get their folders.
    unattended : bool
        Nobody answers the questions of sessions.
    """

    def __init__(self, station: Station, folder: Path, *, unattended: bool) -> None:
        _ = station.site.tracker  # it verifies with one: a site with a gauge is refused at once
        self._station, self._folder, self._unattended = station, folder, unattended
        self._running: Session | WriteBack | None = None

    @property
    def running(self) -> Session | None:
        """The session that runs at this moment, one of a write-back's among them."""
        return self._running.running if isinstance(self._running, WriteBack) else self._running

    @property
    def moves(self) -> bool:
        """Whether a job is under way on the machine; else there is only arithmetic."""
        return self._running is not None

    async def stop(self) -> None:
        """Stop whatever moves at this moment; the job under way ends as it ends when stopped."""
        if self._running is not None:
            await self._running.stop()

    def answer(self, prompt: str, choice: str) -> None:
        """Answer a question of the session that runs."""
        if self.running is not None:
            self.running.answer_prompt(prompt, choice)

    async def choose(self, count: int, seed: int) -> Mapping[str, Pose]:
        """Poses for accuracy, see :func:`app.jobs.posing.choose_poses`."""
        report = await aside(lambda: choose_poses(site=self._station.site, n=count, seed=seed))
        return report.by_label()

    async def measure(
        self,
        poses: Mapping[str, Pose],
        title: str,
        began: Callable[[str], None],
        again: str | None,
    ) -> tuple[str, float]:
        """Measure poses in a session of its own; its run's folder, and the minutes it took."""
        session = self._again(again)
        if session is None:
            session = begin_measuring(
                self._station.site, poses, folder=self._folder, title=title,
                station=self._station, unattended=self._unattended,
            )  # fmt: skip
            began(str(session.folder))
        outcome = await self._run(session)
        return str(outcome.run_folder), _minutes(outcome)

    async def verify(self, began: Callable[[str], None], again: str | None) -> Seen:
        """Measure fresh poses in a session of its own."""
        session = self._again(again)
        if session is None:
            poses = await aside(partial(fresh_poses, self._station.site.machine))
            session = begin_verifying(
                self._station.site, poses, folder=self._folder, station=self._station,
                unattended=self._unattended,
            )  # fmt: skip
            began(str(session.folder))
        outcome = await self._run(session)
        judged = await aside(partial(judge_session, outcome.folder))
        return Seen(*own_part_um(judged), _minutes(outcome))

    async def warm_up(
        self, minutes: float, began: Callable[[str], None], again: str | None
    ) -> float:
        """Keep the machine moving between fresh poses in a session of its own; its minutes."""
        session = self._again(again)
        if session is None:
            site = self._station.site
            fresh = await aside(partial(fresh_poses, site.machine))
            poses = dict(list(fresh.items())[::ROUND])
            session = Session.create(
                site, warming_plan(site, poses, minutes), self._folder, station=self._station,
                unattended=self._unattended,
            )  # fmt: skip
            began(str(session.folder))
        outcome = await self._run(session)
        journal = Journal(outcome.folder / JOURNAL, read_only=True)
        try:
            return journal.last_time() / 60.0
        finally:
            journal.close()

    async def apply(self, model: Path) -> Mapping[str, str]:
        """Write a model through the gates and keep it; what was left out, and why."""

        async def keep(*_: object) -> bool:
            return True  # every gate has passed

        job = WriteBack(
            self._station, read_fit(model), Gates.with_limits({}), self._folder, keep,
            self._unattended,
        )  # fmt: skip
        with self._under_way(job):
            await self._station.connect()
            return (await job.run()).proposal.left_out

    def _again(self, folder: str | None) -> Session | None:
        """A session that was begun before this program was, if it is still there."""
        if folder is None:
            return None
        with suppress(BadInput):
            return Session.reopen(Path(folder), station=self._station, unattended=self._unattended)
        return None

    async def _run(self, session: Session) -> Outcome:
        try:
            with self._under_way(session):
                await self._station.connect()
                return await session.run()
        finally:
            session.journal.close()

    @contextmanager
    def _under_way(self, job: Session | WriteBack) -> Iterator[None]:
        self._running = job
        try:
            yield
        finally:
            self._running = None


def own_part_um(seen: Verification) -> tuple[float, float]:
    """RMS of the position error without what the tracker's noise adds to it, um; its 95 % limit.

    The mean square of errors with covariance C (3N, 3N) exceeds that of the machine by tr(C) / N,
    with a variance of 2 tr(C^2) / N^2 where the machine has no error of its own.
    """
    assert seen.spread is not None
    own, lever, common = seen.spread.own, seen.spread.lever, seen.spread.common
    count = len(own)
    lever = lever[:, :3].reshape(3 * count, 6)
    C = lever @ common @ lever.T
    for k in range(count):
        C[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += own[k, :3, :3]
    shown = float(np.mean(np.sum(seen.position_mm**2, axis=0)))
    square = max(shown - float(np.trace(C)) / count, 0.0)
    open_ = np.sqrt(2.0 * np.sum(C * C)) / count
    return 1e3 * float(np.sqrt(square)), 1e3 * float(np.sqrt(square + SURE_SIGMAS * open_))


def _minutes(outcome: Outcome) -> float:
    """Machine minutes from the first reading to the last."""
    time_s = read_run(outcome.run_folder).run.time_s
    return float(time_s.max() - time_s.min()) / 60.0 if time_s.size else 0.0
