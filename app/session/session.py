"""A session: a plan, a journal and a station; started, paused, stopped, and gone on with.

::

    session = Session.create(site, plan, Path("sessions"))
    leave = session.observers.watch(on_event)      # typed events, app/session/events.py
    await session.connect()
    outcome = await session.start()                # a task; or: await session.run()
    session.pause(); session.resume(); session.skip("bad line of sight")
    session.answer_prompt("prompt-1", "done")
    await session.stop()                           # at any moment, also during a move
    await session.close()

    session = Session.reopen(folder)               # after a stop, a fault or kill -9
"""

import asyncio
import contextlib
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from app.errors import GateRefused, StoppedByOperator
from app.files.site import Site
from app.session.events import (
    Fault,
    Finished,
    Observers,
    Paused,
    Progress,
    Resumed,
    StepDone,
    StepFailed,
    StepSkipped,
    StepStarted,
    Stopped,
)
from app.session.folder import RUN, make_folder, read_folder
from app.session.journal import Journal
from app.session.pace import Pace
from app.session.plan import Plan, Step
from app.session.recall import recall
from app.session.routines import ROUTINES
from app.session.rows import PLANNED, StepState
from app.session.station import Station
from app.session.unwritten import UNWRITTEN, export_at_end, unwritten
from app.session.within import JOURNAL
from app.session.work import Done, LeftOut, StartOver, Work
from calib.errors import BadInput
from drivers.errors import DeviceError
from drivers.interface import Alarm

_WATCH_S = 0.1


@dataclass(frozen=True)
class Outcome:
    """What a finished plan leaves: the folder of the exported run and how many readings."""

    folder: Path
    run_folder: Path
    readings: int


class Session:
    """One plan on one station. See the module's head for its use.

    ``unattended``: nobody answers prompts; their defaults do, and where a person is
    indispensable the session ends with a fault that says so.
    """

    def __init__(
        self,
        folder: Path,
        plan: Plan,
        station: Station,
        journal: Journal,
        *,
        unattended: bool,
        expected: Mapping[str, float] | None = None,
    ) -> None:
        self.folder = folder
        self.plan = plan
        self.station = station
        self.journal = journal
        self.work = Work(station, plan, journal, unattended=unattended, expected=expected)
        self._taken_over_at = journal.last_entry()
        self._going = asyncio.Event()
        self._going.set()
        self._driving: asyncio.Task[None] | None = None
        self._step_task: asyncio.Task[Done] | None = None
        self._skip_why: str | None = None
        self._stopping = False

    # making

    @classmethod
    def create(
        cls,
        site: Site,
        plan: Plan,
        root: Path = Path("sessions"),
        *,
        station: Station | None = None,
        unattended: bool = False,
        expected: Mapping[str, float] | None = None,
    ) -> "Session":
        """Begin a session in a new folder under ``root``: site, plan and journal are there.

        ``expected`` are the parameters that the controller should hold, where they are not those
        that this program last left there for good (during a write-back).
        """
        folder = make_folder(root, site, plan)
        journal = Journal(folder / JOURNAL)
        return cls(
            folder,
            plan,
            station or Station(site),
            journal,
            unattended=unattended,
            expected=expected,
        )

    @classmethod
    def reopen(
        cls, folder: Path, *, station: Station | None = None, unattended: bool = False
    ) -> "Session":
        """Go on with a session that ended early, however it ended.

        Raises
        ------
        BadInput
            If the folder holds no session.
        """
        site, plan = read_folder(folder)
        journal = Journal(folder / JOURNAL)
        journal.enter_plan(plan)
        return cls(folder, plan, station or Station(site), journal, unattended=unattended)

    @property
    def observers(self) -> Observers:
        """Who is told; :meth:`Observers.watch` joins."""
        return self.station.observers

    def steps(self) -> Sequence[tuple[Step, StepState]]:
        """Every step with its state, for a list on a screen."""
        states = self.journal.states()
        return [(step, states.get(step.id, PLANNED)) for step in self.plan.steps]

    def due(self) -> list[Step]:
        """The steps that are still to be done, in order.

        By the journal: those that did not end well or were not begun, and those that are done
        every time and were last done before this session was taken over.
        """
        return [
            step
            for step, state in self.steps()
            if state.pending or (step.kind.every_time and state.entry <= self._taken_over_at)
        ]

    # the operator's keys

    async def connect(self) -> None:
        """Connect to the devices and own the machine; see :meth:`Station.connect`."""
        await self.station.connect()

    def start(self) -> "asyncio.Task[Outcome]":
        """Run the plan in a task of its own."""
        return asyncio.create_task(self.run(), name="session")

    def pause(self) -> None:
        """Hold when the step in work has ended; the beam is kept."""
        if self._going.is_set():
            self._going.clear()
            self.work.note("paused", "by the operator")
            self.observers.tell(Paused())

    def resume(self) -> None:
        """Go on after a pause."""
        if not self._going.is_set():
            self._going.set()
            self.work.note("resumed", "by the operator")
            self.observers.tell(Resumed())

    @property
    def paused(self) -> bool:
        """Whether the operator paused."""
        return not self._going.is_set()

    def skip(self, why: str) -> None:
        """Leave the step in work out; raises :class:`GateRefused` for one that safety needs."""
        step = next((s for s in self.plan.steps if s.id == self.work.step), None)
        if self._step_task is None or step is None:
            raise GateRefused("no step is in work", remedy="Skip while a step runs")
        if not step.kind.skippable:
            raise GateRefused(f"{step.says}: cannot be skipped", remedy="Stop instead")
        self._skip_why = why
        self._step_task.cancel()

    def stop_at_once(self) -> None:
        """Send the stop of the motion from any thread; :meth:`stop` must follow."""
        self._stopping = True  # what the engine now hears of the motion is no fault
        self.station.stop_at_once()

    async def stop(self) -> None:
        """Stop everything now: motion first. :meth:`run` ends with StoppedByOperator."""
        self._stopping = True
        halted = asyncio.create_task(self.station.safe_stop())
        if self._driving is not None:
            self._driving.cancel()
        await asyncio.sleep(0)  # the stop is on its way before anything is written
        with contextlib.suppress(sqlite3.Error):
            self.work.note("stop", "asked for by the operator")
        await halted

    def answer_prompt(self, prompt: str, choice: str) -> None:
        """Answer a :class:`PromptNeeded` with one of its choices."""
        self.work.answer(prompt, choice)

    async def close(self) -> None:
        """Let go of devices and journal."""
        await self.station.close()
        self.journal.close()

    # the engine

    async def run(self) -> Outcome:
        """Do every step that is not done, in order; then export the run.

        Raises
        ------
        StoppedByOperator
            After :meth:`stop`.
        DeviceError
            On a fault; the machine was brought to a stop, and the session can be gone on with.
        """
        self.station.clock.start_at(self.journal.last_time())
        recall(self.work)
        self.work.guarded = False
        leave = self.station.on_alarm(self._hear)
        self._driving = asyncio.create_task(self._drive(), name="engine")
        watch = asyncio.create_task(self._watch(), name="watch")
        try:
            done, _ = await asyncio.wait(
                {self._driving, watch}, return_when=asyncio.FIRST_COMPLETED
            )
            fault = watch.exception() if watch in done else None
            if isinstance(fault, DeviceError):
                await self._end(self._driving)
                raise fault
            await self._driving
        except asyncio.CancelledError:
            await self._end(self._driving)
            await self.station.safe_stop()
            if not self._stopping:
                raise
            raise self._stopped() from None
        except (DeviceError, GateRefused, BadInput) as fault:
            safe = await self.station.safe_stop()
            if self._stopping:
                raise self._stopped() from fault
            with contextlib.suppress(sqlite3.Error):
                self.work.note("fault", str(fault))
            remedy = (
                f"{(fault.remedy or 'Put it right').rstrip('.')}; then: pkmcal resume {self.folder}"
            )
            self.observers.tell(Fault(_named(fault), remedy, safe))
            raise
        except StoppedByOperator:
            await self.station.safe_stop()
            raise self._stopped() from None
        except UNWRITTEN as error:
            safe = await self.station.safe_stop()
            lost = unwritten(error, self.folder)
            self.observers.tell(Fault(lost.what, lost.remedy, safe))
            raise lost from error
        except BaseException:
            await self.station.safe_stop()
            raise
        finally:
            await self._end(watch)
            leave()
            self._driving = None
            export_at_end(self.work.site, self.plan, self.journal, self.folder)
        return self._finish()

    async def _drive(self) -> None:
        pace, now = Pace(), asyncio.get_running_loop().time
        due = self.due()
        while due:
            await self._going.wait()
            begun = now()
            await self._do(self.plan.steps.index(due[0]), due[0])
            pace.took(due[0], now() - begun)
            due = self.due()
            self.observers.tell(Progress(self._done_count(), len(self.plan.steps), pace.left(due)))

    def _done_count(self) -> int:
        return sum(not state.pending for state in self.journal.states().values())

    async def _do(self, index: int, step: Step) -> None:
        """Do one step: started, then done with its reading, failed, or skipped."""
        attempt = self.journal.state(step.id).attempt + 1
        self.work.step, self.work.attempt = step.id, attempt
        clock = self.station.clock
        self.journal.started(step.id, attempt, clock.now(), clock.utc())
        self.observers.tell(
            StepStarted(step.id, index, step.kind.name, step.says, attempt, clock.now())
        )
        self._skip_why = None
        self._step_task = asyncio.create_task(ROUTINES[step.kind](self.work, step))
        try:
            done = await self._step_task
        except asyncio.CancelledError:
            skipped = self._skip_asked()
            if skipped is None:
                self._failed(index, step, attempt, "stopped")
                raise
            self._skipped(index, step, attempt, skipped)
            return
        except DeviceError as error:
            self._failed(index, step, attempt, str(error))
            raise
        except LeftOut as left:
            self._skipped(index, step, attempt, str(left))
            return
        except StartOver as moved:
            self._failed(index, step, attempt, str(moved))
            return
        except (StoppedByOperator, GateRefused, BadInput) as error:
            self._failed(index, step, attempt, str(error))
            raise
        finally:
            self._step_task = None
        self.journal.done(step.id, attempt, clock.now(), clock.utc(), done.result, done.reading)
        for event in done.news:
            self.observers.tell(event)
        self.observers.tell(StepDone(step.id, index, done.summary, clock.now()))

    def _skip_asked(self) -> str | None:
        """Why the step in work is to be left out; None if it is not."""
        return None if self._stopping else self._skip_why

    def _failed(self, index: int, step: Step, attempt: int, what: str) -> None:
        clock = self.station.clock
        self.journal.failed(step.id, attempt, clock.now(), clock.utc(), what)
        self.observers.tell(StepFailed(step.id, index, what, clock.now()))

    def _skipped(self, index: int, step: Step, attempt: int, why: str) -> None:
        clock = self.station.clock
        self.journal.skipped(step.id, attempt, clock.now(), clock.utc(), why)
        self.observers.tell(StepSkipped(step.id, index, why, clock.now()))

    async def _watch(self) -> None:
        """Look for standing faults (heartbeat, link, drive) while steps run."""
        while True:
            await asyncio.sleep(_WATCH_S)
            if self.work.guarded:
                self.station.check()

    async def _end(self, task: "asyncio.Task[None]") -> None:
        """Cancel a task and wait until it has ended; its own error is already known."""
        task.cancel()
        ended = (asyncio.CancelledError, DeviceError, StoppedByOperator, GateRefused, *UNWRITTEN)
        with contextlib.suppress(*ended):
            await task

    def _stopped(self) -> StoppedByOperator:
        remedy = f"Go on with: pkmcal resume {self.folder}"
        with contextlib.suppress(sqlite3.Error):
            self.work.note("stopped", "by the operator")
        self.observers.tell(Stopped(remedy))
        return StoppedByOperator("stopped by the operator; the machine stands", remedy=remedy)

    def _hear(self, alarm: Alarm) -> None:
        self.work.note("alarm", f"{alarm.device}: {alarm.what}")

    def _finish(self) -> Outcome:
        run_folder = self.folder / RUN
        readings = self.journal.readings()
        self.journal.set_meta("finished_utc", datetime.now(UTC).isoformat(timespec="seconds"))
        self.observers.tell(Finished(str(run_folder), readings))
        return Outcome(self.folder, run_folder, readings)


def _named(fault: DeviceError | GateRefused | BadInput) -> str:
    """What happened, and to which device or in which file."""
    where = getattr(fault, "device", "") or getattr(fault, "place", "")
    return f"{where}: {fault.what}" if where else fault.what
