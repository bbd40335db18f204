"""What the operator has in front of him: a site, a station, perhaps a mock, perhaps a session.

The screens call these coroutines and nothing else. Errors are raised to the program, which puts
them on the banner. Nothing here draws.
"""

import asyncio
import contextlib
from collections.abc import Coroutine, Sequence
from pathlib import Path
from typing import Any, TypeVar

from app.errors import GateRefused, StoppedByOperator
from app.files.site import Site, load_site
from app.session import events as ev
from app.session.plan import Plan
from app.session.session import Outcome, Session
from app.session.station import Station
from app.tui.automatic import DECIDE, Automatic
from app.tui.correction import KEEP, Corrections
from app.tui.course import Course
from app.tui.history_view import LookingBack
from app.tui.mock_process import MockProcess
from app.tui.picture import Picture
from app.tui.study import Study
from app.tui.verifying import verification_plan
from app.tui.watching import Watching
from app.writeback.transfer import snapshots_of
from calib.errors import BadInput
from drivers.errors import ConnectFailed, DeviceError

_Answer = TypeVar("_Answer")
POLL_S = 0.5
ENDS = (StoppedByOperator, GateRefused, DeviceError)
"""How a job ends early."""


class Desk:
    """One site at a time; see the module's head.

    Parameters
    ----------
    root : Path
        Folder under which new sessions get theirs.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.picture = Picture()
        self.site: Site | None = None
        self.station: Station | None = None
        self.session: Session | None = None
        self.mock: MockProcess | None = None
        self._job: asyncio.Task[Any] | None = None
        self.corrections = Corrections(self)
        self.automatic = Automatic(self)
        self._connecting = False
        self.study = Study(root, self.picture)
        self.past = LookingBack(root, self.picture)
        self.course = Course(root, self.picture, self.study)
        self.watched: Watching | None = None

    # site and mock

    async def open_site(self, path: Path) -> None:
        """Read a site file; the devices of another site are let go first."""
        site = load_site(path)
        await self._use(site)

    async def _use(self, site: Site) -> None:
        self._not_while_busy("change the site")
        await self.disconnect()
        self.site = site
        self.course.begin()
        self.study.offers = site.offers
        self.station = Station(site)
        self.station.observers.watch(self._hear)
        self.picture.write(f"site {site.title or site.source}")

    async def start_mock(self, arguments: Sequence[str] = ("hexapod",)) -> None:
        """Start a mock station as a process and take its site; raises a DeviceError if it fails."""
        self._not_while_busy("start a mock")
        await self.end_mock()
        mock = await MockProcess.start(arguments, lambda line: self.picture.write(f"mock: {line}"))
        self.mock = mock
        await self._use(mock.site)
        self.picture.write("mock station started", "good")

    async def end_mock(self) -> None:
        """End the mock station that was started here, if any."""
        mock, self.mock = self.mock, None
        if mock is not None:
            await mock.end()

    # devices

    @property
    def connected(self) -> bool:
        """Whether both devices are connected."""
        return self.station is not None and self.station.connected

    async def connect(self) -> None:
        """Connect to the site's devices; raises a DeviceError or GateRefused."""
        if self.connected or self._connecting:
            return
        station = self._need_station()
        if self.mock is not None and self.mock.ended:
            raise ConnectFailed(
                "the mock station that was started here has ended",
                device="mock station",
                remedy="Start another one (m)",
            )
        self._connecting = True
        try:
            await station.connect()
            self.picture.trouble = None
            await station.poll()
        finally:
            self._connecting = False
        await self._recall(station)

    async def _recall(self, station: Station) -> None:
        known = snapshots_of(station).all()
        try:
            await self.course.recall(
                station.controller.identity.serial, known[-1].number if known else None
            )
        except BadInput as error:  # what cannot be read is no reason not to work
            self.picture.write(f"what was done before is not known: {error}", "warn")

    async def disconnect(self) -> None:
        """Let the devices go."""
        self._not_while_busy("disconnect")
        if self.station is not None and self.station.connected:
            await self.station.close()

    async def poll(self) -> None:
        """Ask for the devices' states, but never into a running job: that tells by itself.

        Where neither answers any more, both are let go, so that they can be connected anew.
        """
        if not self.connected or self.busy or self.station is None:
            return
        states = await self.station.poll()
        if not any((states.controller, states.tracker, states.gauge)) and not self.busy:
            await self.station.close()
            fault = self.picture.trouble if self.picture.run == "fault" else None
            self.picture.say_trouble(
                "Neither controller nor what measures answers",
                "Look at power and network, then connect again (c on the Devices screen)",
            )
            self.picture.trouble = fault or self.picture.trouble

    async def clear_faults(self) -> None:
        """Reset standing faults of the drives; they stay without power."""
        station = self.idle_station("clear faults")
        await station.controller.clear_faults()
        self.picture.trouble = None
        self.picture.write("faults cleared; drives are off", "good")
        await station.poll()

    async def power(self, on: bool) -> None:
        """Switch the drives on or off."""
        station = self.idle_station("switch the drives")
        await (station.controller.enable() if on else station.controller.disable())
        await station.poll()

    # the job

    @property
    def busy(self) -> bool:
        """Whether a session runs."""
        return self._job is not None and not self._job.done()

    async def run(self, plan: Plan) -> Outcome:
        """Begin a session with this plan and run it to its end; raises what ended it early."""
        station = self.idle_station("begin")
        return await self._run(Session.create(station.site, plan, self.root, station=station))

    def _hear(self, event: ev.Event) -> None:
        """Take an event; write-backs and the autopilot begin sessions of their own."""
        inner = self.corrections.session or self.automatic.session
        if inner is not None and inner is not self.session:
            self.session = inner
            self.picture.begin(inner)
        self.picture.tell(event)
        outer = self.corrections.running or self.automatic.running
        if outer is not None and isinstance(event, ev.Finished):
            self.picture.run = "running"  # the session is done, what began it is not

    async def as_job(self, work: Coroutine[Any, Any, _Answer]) -> _Answer:
        """Run something as the one job that the stop key stops."""
        self.session = None
        job = asyncio.create_task(work, name="job")
        self._job = job
        try:
            return await job
        except asyncio.CancelledError:
            if job.cancelled():
                raise StoppedByOperator from None
            raise

    async def go_on(self, folder: Path) -> Outcome:
        """Go on with a session that ended early."""
        station = self.idle_station("go on")
        return await self._run(Session.reopen(folder, station=station))

    async def _run(self, session: Session) -> Outcome:
        self.session = session
        self.picture.begin(session)
        self._job = session.start()
        await asyncio.sleep(0)  # the session recalls from its journal where the base is
        self.picture.recall(session)
        try:
            outcome = await self._job
        except ENDS as end:
            if self.picture.busy:  # nobody told yet how it ended
                self.picture.run = "stopped" if isinstance(end, StoppedByOperator) else "fault"
            raise
        finally:
            session.journal.close()
        if session.plan.purpose == "verify":
            await self.course.judge(outcome.folder)
        elif session.plan.purpose == "measure":
            self.course.measured(outcome.run_folder)
        return outcome

    # what became of it

    async def look_back(self) -> None:
        """Read the history of this folder; the machine that is connected is shown first."""
        serial = ""
        if self.connected and self.station is not None:
            serial = self.station.controller.identity.serial
        tolerance = self.site.record.tolerance_um if self.site is not None else None
        await self.past.look(serial, tolerance)

    # what it is worth

    async def verify(self, quick: bool) -> None:
        """Measure the verification poses and judge them."""
        site = self.idle_station("verify").site
        await self.run(await verification_plan(site, quick))

    async def write_record(self, outs: Sequence[Path]) -> None:
        """Write the calibration record of what is studied."""
        await self.course.write_record(self.site, self.corrections.model_file(), outs)

    # the operator's keys

    def pause_or_resume(self) -> None:
        """Hold after the step in work, or go on."""
        session = self._running_session()
        if session.paused:
            session.resume()
        else:
            session.pause()

    def skip(self) -> None:
        """Leave the step in work out."""
        self._running_session().skip("left out by the operator")

    def answer(self, prompt: str, choice: str) -> None:
        """Answer the job's question."""
        if prompt == KEEP:
            self.corrections.answer(choice)
        elif prompt == DECIDE:
            self.automatic.answer(choice)
        else:
            self._running_session().answer_prompt(prompt, choice)

    def stop_at_once(self) -> None:
        """Send the stop of whatever moves from any thread; :meth:`stop` follows."""
        if self.busy and self.session is not None:
            self.session.stop_at_once()
        elif self.station is not None:
            self.station.stop_at_once()

    async def stop(self) -> str:
        """Stop whatever moves, at any moment. Returns what was done, in words."""
        flight = self.automatic.running
        if self.busy and flight is not None:
            await flight.stop()
            return await self._halt()
        write_back = self.corrections.running
        if self.busy and write_back is not None and write_back.running is not None:
            await write_back.stop()
            return "stopped; the earlier parameters are being put back"
        if self.busy and write_back is None and self.session is not None:
            await self.session.stop()
            return "stopped; the machine stands still"
        halted = await self._halt()
        if self._job is not None and self.corrections.may_be_cancelled:
            self._job.cancel()  # it puts back by itself what it has changed
        return halted

    async def _halt(self) -> str:
        if self.connected and self.station is not None:
            confirmed = await self.station.safe_stop()
            return "all motion stopped" if confirmed else "STOP NOT CONFIRMED: use the e-stop"
        return "nothing is connected, nothing moves"

    async def close(self) -> None:
        """End everything that was begun here."""
        if self.busy and self._job is not None:
            await self.stop()
            with contextlib.suppress(*ENDS, asyncio.CancelledError):
                await self._job
        if self.station is not None:
            await self.station.close()
        await self.end_mock()

    # who is allowed what

    def _need_station(self) -> Station:
        if self.station is None:
            raise GateRefused(
                "no site is open",
                remedy="Open a site file (o) or start a mock (m) on the Devices screen (1)",
            )
        return self.station

    def idle_station(self, wish: str) -> Station:
        """The connected station while no job runs; raises what stands against it."""
        station = self._need_station()
        if not station.connected:
            raise GateRefused(
                f"cannot {wish}: the devices are not connected",
                remedy="Connect on the Devices screen first (1 c)",
            )
        self._not_while_busy(wish)
        return station

    def _not_while_busy(self, wish: str) -> None:
        if self.busy:
            raise GateRefused(
                f"cannot {wish} while a job runs", remedy="Wait until it ends, or stop it (ctrl+x)"
            )

    def _running_session(self) -> Session:
        if self.session is None or not self.busy:
            raise GateRefused("no job runs", remedy="Start one on the Measure screen")
        return self.session
