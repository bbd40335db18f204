"""A station for asynchronous scripts: its devices stay connected from one job to the next."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from app.auto.flight import Flight, folder_of, limits_of
from app.auto.station import StationLaboratory
from app.defaults import REFERENCE_EVERY
from app.errors import GateRefused, StoppedByOperator
from app.files.fits import read_fit
from app.files.pose_table import Pose
from app.files.site import Site, load_site
from app.jobs.applying import (
    AcceptReport,
    ApplyReport,
    SetsReport,
    UndoReport,
    accept_held,
    apply_report,
    bring_back,
    known_sets,
)
from app.jobs.automatic import AutoReport
from app.jobs.chosen_runs import File, at_least, path_of
from app.jobs.measuring import SessionReport, begin_again, begin_measuring, session_report
from app.jobs.verifying import (
    VerificationReport,
    begin_verifying,
    concluded,
    is_verification,
    read_before,
    verification_report,
)
from app.session.events import Event, PromptNeeded
from app.session.session import Outcome, Session
from app.session.station import Station as Connection
from app.writeback.gates import Gates
from app.writeback.procedure import WriteBack
from app.writeback.proposal import Proposal
from calib.errors import BadInput
from calib.pose_error import Summary
from drivers.errors import DeviceError

Operator = Callable[[str, tuple[str, ...]], str]
"""Called with a question and the answers to it; returns one of them, as late as it likes."""
Order = Literal["nest-by-nest", "pose-by-pose"]
KEEP = ("keep", "put back")


class AsyncStation:
    """One site's controller and tracker, for asynchronous scripts; see :class:`Station`.

    The methods are those of :class:`Station`, as coroutines; one at a time.

    Parameters
    ----------
    site, folder, operator, watch
        As for :class:`Station`; ``watch`` is called in the event loop and must return at once.

    Examples
    --------
    >>> async with pkmcal.AsyncStation("site.toml") as station:              # doctest: +SKIP
    ...     measured = await station.measure("poses.toml")
    """

    def __init__(
        self,
        site: File,
        *,
        folder: File = "sessions",
        operator: Operator | None = None,
        watch: Callable[[Event], None] | None = None,
    ) -> None:
        self.site: Site = load_site(Path(site))
        self.folder = Path(folder)
        self._operator = operator
        self._connection = Connection(self.site)
        self._connection.observers.watch(self._hear)
        self._watch = watch
        self._running: Session | WriteBack | Flight | None = None
        self._busy = False
        self._fault: Exception | None = None
        self._asking: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def connect(self) -> None:
        """Own the machine and connect; see :meth:`Station.connect`."""
        await self._connection.connect()

    async def close(self) -> None:
        """Let go of devices and machine."""
        await self._connection.close()

    async def stop(self) -> None:
        """Stop all motion now; the job under way ends with :class:`StoppedByOperator`."""
        if self._running is not None:
            await self._running.stop()
        else:
            await self._connection.safe_stop()

    async def measure(
        self,
        poses: File | Mapping[str, Pose],
        *,
        order: Order | None = None,
        reference_every: int = 10,
        cycles: int = 1,
        warm_up: bool = True,
        title: str = "",
        pairs: Sequence[tuple[str, str]] = (),
    ) -> SessionReport:
        """Measure poses; see :meth:`Station.measure`."""
        at_least(1, reference_every=reference_every, cycles=cycles)
        session = begin_measuring(
            self.site,
            poses,
            folder=self.folder,
            order=order,
            reference_every=reference_every,
            cycles=cycles,
            warm_up=warm_up,
            title=title,
            pairs=pairs,
            station=self._connection,
            unattended=self._operator is None,
        )
        return session_report(await self._run(session))

    async def resume(self, session: File | None = None) -> SessionReport:
        """Go on with a session; see :meth:`Station.resume`."""
        again = begin_again(
            session,
            folder=self.folder,
            station=self._connection,
            unattended=self._operator is None,
        )
        outcome = await self._run(again)
        if is_verification(again):
            concluded(outcome.folder)
        return session_report(outcome)

    async def verify(
        self,
        poses: File | Mapping[str, Pose] | None = None,
        *,
        truth: bool = False,
        reference_every: int = REFERENCE_EVERY,
        before: File | VerificationReport | None = None,
    ) -> VerificationReport:
        """Measure the error that is left; see :meth:`Station.verify`."""
        at_least(1, reference_every=reference_every)
        earlier: dict[str, Any] | None = None
        if isinstance(before, VerificationReport):
            earlier = before.to_json()
        elif before is not None:
            earlier = read_before(Path(before))
        session = begin_verifying(
            self.site,
            poses,
            folder=self.folder,
            truth=truth,
            reference_every=reference_every,
            before=None if isinstance(before, VerificationReport) else path_of(before),
            station=self._connection,
            unattended=self._operator is None,
        )
        return verification_report((await self._run(session)).folder, earlier)

    async def auto(
        self,
        target_um: float | None = None,
        *,
        hours: float | None = None,
        first: int = 15,
        apply: bool = True,
        seed: int = 1,
        out: File | None = None,
        decide: Operator | None = None,
        tell: Callable[[str], None] | None = None,
    ) -> AutoReport:
        """Decide by itself what to do next; see :meth:`Station.auto`."""
        folder = folder_of(out)
        limits = limits_of(folder, target_um, hours, first, apply=apply)
        laboratory = StationLaboratory(
            self._connection, folder / "sessions", unattended=self._operator is None
        )

        async def ask(text: str, answers: tuple[str, ...], typed: str) -> str:
            assert decide is not None
            asked = f"{text}; {typed}" if typed else text
            return await asyncio.to_thread(decide, asked, answers)

        flight = Flight(
            laboratory, folder, limits, seed, None if decide is None else ask,
            tell or (lambda _: None),
        )  # fmt: skip
        async with self._job(flight):
            return await flight.run()

    async def propose(self, fit: File, *, limits: Mapping[str, float] | None = None) -> ApplyReport:
        """What would be written; see :meth:`Station.propose`."""
        job = self._write_back(fit, limits, yes=False)
        async with self._job(job):
            _, proposal = await job.propose()
            return apply_report(proposal)

    async def apply(
        self, fit: File, *, yes: bool = False, limits: Mapping[str, float] | None = None
    ) -> ApplyReport:
        """Write a fit through the gates; see :meth:`Station.apply`."""
        if not yes and self._operator is None:
            raise BadInput(
                "nobody is there to confirm what is written",
                remedy="Say yes=True to keep what passes every gate, or give an operator",
            )
        job = self._write_back(fit, limits, yes=yes)
        async with self._job(job):
            applied = await job.run()
            return apply_report(applied.proposal, applied)

    async def undo(self, to: int | None = None) -> UndoReport:
        """Bring an earlier set back; see :meth:`Station.undo`."""
        async with self._job(None):
            return await bring_back(self._connection, to)

    async def accept(self) -> AcceptReport:
        """Take what the controller holds as known; see :meth:`Station.accept`."""
        async with self._job(None):
            return await accept_held(self._connection)

    async def sets(self) -> SetsReport:
        """The sets of this controller; see :meth:`Station.sets`."""
        async with self._job(None):
            return known_sets(self._connection)

    def _write_back(self, fit: File, limits: Mapping[str, float] | None, *, yes: bool) -> WriteBack:
        async def confirm(proposal: Proposal, before: Summary, after: Summary) -> bool:
            if yes or self._operator is None:
                return yes
            text = (
                f"{len(proposal.changes)} parameters; check poses: peak "
                f"{before.position_peak_um:.1f} um before, {after.position_peak_um:.1f} um now. "
                "Keep these parameters?"
            )
            return await asyncio.to_thread(self._operator, text, KEEP) == KEEP[0]

        return WriteBack(
            self._connection,
            read_fit(Path(fit)),
            Gates.with_limits(limits or {}),
            self.folder,
            confirm,
            unattended=self._operator is None,
        )

    @asynccontextmanager
    async def _job(self, running: Session | WriteBack | Flight | None) -> AsyncIterator[None]:
        """Connect, remember what :meth:`stop` stops, and let the devices go after a fault."""
        if self._busy:
            raise GateRefused("another job is under way", remedy="Wait for it, or stop it")
        self._busy, self._running, self._fault = True, running, None
        try:
            await self._connection.connect()
            yield
        except DeviceError:
            await self._connection.close()  # the next job connects anew
            raise
        except StoppedByOperator:
            if self._fault is not None:  # it was the operator function that failed
                raise self._fault from None
            raise
        finally:
            self._busy, self._running = False, None

    async def _run(self, session: Session) -> Outcome:
        try:
            async with self._job(session):
                return await session.run()
        finally:
            session.journal.close()

    def _hear(self, event: Event) -> None:
        if self._watch is not None:
            self._watch(event)
        if isinstance(event, PromptNeeded) and self._operator is not None:
            asking = asyncio.get_running_loop().create_task(self._ask(event, self._operator))
            self._asking.add(asking)
            asking.add_done_callback(self._asking.discard)

    async def _ask(self, prompt: PromptNeeded, operator: Operator) -> None:
        """Ask the script, beside the event loop, and hand its answer on; a fault there stops."""
        try:
            given = await asyncio.to_thread(operator, prompt.text, prompt.choices)
            session = _session_of(self._running)
            if session is not None:
                session.answer_prompt(prompt.prompt, given)
        except Exception as fault:
            self._fault = fault
            await self.stop()


def _session_of(running: Session | WriteBack | Flight | None) -> Session | None:
    """The session that may have asked something."""
    if isinstance(running, Flight):
        return running.laboratory.running
    return running.running if isinstance(running, WriteBack) else running
