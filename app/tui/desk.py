"""What the operator has in front of him: a site, a station, perhaps a mock, perhaps a session.

The screens call these coroutines and nothing else. Errors are raised to the program, which puts
them on the banner. Nothing here draws.
"""

import asyncio
import contextlib
import json
from collections.abc import Coroutine, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from app.again import command_of
from app.errors import GateRefused, StoppedByOperator
from app.files.site import Site, load_site, site_of_mock
from app.session import events as ev
from app.session.plan import Plan
from app.session.session import Outcome, Session
from app.session.station import Station
from app.tui.automatic import DECIDE, Automatic
from app.tui.correction import KEEP, Corrections
from app.tui.history_view import LookingBack
from app.tui.picture import Picture
from app.tui.study import Study
from app.tui.verifying import Verified, verification_plan, verified
from app.tui.watching import Watching
from drivers.errors import ConnectFailed, DeviceError, Silence

_Answer = TypeVar("_Answer")
MOCK_START_S = 30.0
MOCK_END_S = 5.0
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
        self.mock: asyncio.subprocess.Process | None = None
        self._mock_log: asyncio.Task[None] | None = None
        self._job: asyncio.Task[Any] | None = None
        self.corrections = Corrections(self)
        self.automatic = Automatic(self)
        self._connecting = False
        self.study = Study(root, self.picture)
        self.past = LookingBack(root, self.picture)
        self.watched: Watching | None = None
        self.before: Verified | None = None
        self.after: Verified | None = None
        self.done: set[str] = set()
        """What was done with the open site: ``found``, ``applied``, ``left``, ``record``."""

    # site and mock

    async def open_site(self, path: Path) -> None:
        """Read a site file; the devices of another site are let go first."""
        site = load_site(path)
        await self._use(site)

    async def _use(self, site: Site) -> None:
        self._not_while_busy("change the site")
        await self.disconnect()
        self.site = site
        self.done.clear()
        self.study.offers = site.offers
        self.station = Station(site)
        self.station.observers.watch(self._hear)
        self.picture.write(f"site {site.title or site.source}")

    async def start_mock(self, arguments: Sequence[str] = ("hexapod",)) -> None:
        """Start a mock station as a process and take its site; raises a DeviceError if it fails."""
        self._not_while_busy("start a mock")
        await self.end_mock()
        # However this program ends, its mock's standard input ends with it, and so does the mock.
        ends_with_us = ("--json", "--until-stdin-closes")
        process = await asyncio.create_subprocess_exec(
            *command_of("mock", *arguments, *ends_with_us),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        self.mock = process
        assert process.stdout is not None
        try:
            async with asyncio.timeout(MOCK_START_S):
                line = await process.stdout.readline()
        except TimeoutError as error:
            await self.end_mock()
            raise Silence(
                f"said nothing within {MOCK_START_S:.0f} s", device="mock station"
            ) from error
        if not line:
            said = await self._last_words(process)
            await self.end_mock()
            raise ConnectFailed(f"it ended at once: {said}", device="mock station")
        # Pipes that nobody reads fill up and block the station.
        self._mock_log = asyncio.create_task(self._drain(process))
        await self._use(site_of_mock(json.loads(line)))
        self.picture.write("mock station started", "good")

    async def _last_words(self, process: asyncio.subprocess.Process) -> str:
        assert process.stderr is not None
        try:
            async with asyncio.timeout(MOCK_END_S):
                lines = (await process.stderr.read()).decode(errors="replace").strip().splitlines()
        except TimeoutError:
            return "no reason given"
        return lines[-1] if lines else "no reason given"

    async def _drain(self, process: asyncio.subprocess.Process) -> None:
        async def read(stream: asyncio.StreamReader | None) -> None:
            while stream is not None and (line := await stream.readline()):
                self.picture.write(f"mock: {line.decode(errors='replace').rstrip()}")

        await asyncio.gather(read(process.stdout), read(process.stderr))

    async def end_mock(self) -> None:
        """End the mock station that was started here, if any."""
        process, self.mock = self.mock, None
        if process is None:
            return
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            try:
                async with asyncio.timeout(MOCK_END_S):
                    await process.wait()
            except TimeoutError:
                process.kill()
                await process.wait()
        if self._mock_log is not None:
            self._mock_log.cancel()
            self._mock_log = None

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
        if self.mock is not None and self.mock.returncode is not None:
            raise ConnectFailed(
                "the mock station that was started here has ended", remedy="Start another one (m)"
            )
        self._connecting = True
        try:
            await station.connect()
            self.picture.trouble = None
            await station.poll()
        finally:
            self._connecting = False

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
        if states.controller is None and states.tracker is None and not self.busy:
            await self.station.close()
            fault = self.picture.trouble if self.picture.run == "fault" else None
            self.picture.say_trouble(
                "Neither controller nor tracker answers",
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
            await self._judge(outcome.folder)
        elif session.plan.purpose == "measure":
            self.study.choose((str(outcome.run_folder),))
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

    async def _judge(self, folder: Path) -> None:
        """Judge a finished verification; the last one before it becomes 'before'."""
        judged = await asyncio.to_thread(verified, folder)
        if self.after is not None:
            self.before = self.after
        self.after = judged
        self.done.add("left" if "applied" in self.done else "found")
        self.done.discard("record")
        found = judged.found.measured
        self.picture.write(
            f"verified {len(judged.found.labels)} poses: peak {found.position_peak_um:.1f} um, "
            f"{found.orientation_peak_deg:.4f} deg",
            "good",
        )

    async def load_before(self, folder: Path) -> None:
        """Let an earlier verification stand as 'before'."""
        self.before = await asyncio.to_thread(verified, folder)
        self.picture.write(f"before: {folder.name}")

    async def write_record(self, outs: Sequence[Path]) -> None:
        """Write the calibration record of the runs that are studied, beside the other steps."""
        model = self.corrections.model_file()
        runs = self.study.runs
        from app.report.build import Asked, write_report  # brings matplotlib: not at start

        asked = Asked(
            model=model,
            mask=self.study.masked,
            before=self.before.folder if self.before is not None else None,
            after=self.after.folder if self.after is not None else None,
            site=self.site,
        )
        if asked.before is None and "applied" not in self.done:
            asked = replace(asked, before=asked.after, after=None)

        await asyncio.to_thread(write_report, runs, asked, outs)
        self.done.add("record")
        self.picture.write(f"calibration record in {' and '.join(map(str, outs))}", "good")

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
            raise ConnectFailed(
                "no site is open", remedy="Open a site file (o) or start a mock (m) first"
            )
        return self.station

    def idle_station(self, wish: str) -> Station:
        """The connected station while no job runs; raises what stands against it."""
        station = self._need_station()
        if not station.connected:
            raise ConnectFailed(
                f"cannot {wish}: the devices are not connected",
                remedy="Connect on the Devices screen first",
            )
        self._not_while_busy(wish)
        return station

    def _not_while_busy(self, wish: str) -> None:
        if self.busy:
            raise GateRefused(f"cannot {wish} while a job runs", remedy="Stop the job first")

    def _running_session(self) -> Session:
        if self.session is None or not self.busy:
            raise GateRefused("no job runs", remedy="Start one on the Measure screen")
        return self.session
