"""Corrections: compare a fit with the controller, write it, bring earlier sets back."""

import asyncio
import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from app.errors import GateRefused, StoppedByOperator
from app.files.fits import read_fit
from app.hosted.controller import HostedController
from app.session import events as ev
from app.session.known import Snapshot, compare_with_known
from app.session.session import Session
from app.session.station import Station
from app.tui.wording import said
from app.writeback.gates import Gates
from app.writeback.procedure import WriteBack, accept, judged, undo
from app.writeback.proposal import Proposal
from app.writeback.transfer import snapshots_of
from calib.errors import BadInput
from calib.pose_error import Summary
from drivers.errors import DeviceError

if TYPE_CHECKING:
    from app.tui.desk import Desk

KEEP = "keep"
"""Name of the question whether the corrections that are on trial are to be kept."""


@dataclass(frozen=True)
class Comparison:
    """What would be written, and what the gates say about it."""

    model: Path
    proposal: Proposal
    gates: tuple[ev.GateChecked, ...]
    loaded: bool = False
    """The model is a file that the operator chose, not the fit on the Fit screen."""

    @property
    def passed(self) -> bool:
        """Whether every gate passed."""
        return all(gate.passed for gate in self.gates)


class Corrections:
    """What the Apply screen does; jobs run as the desk's job."""

    def __init__(self, desk: "Desk") -> None:
        self._desk = desk
        self.comparison: Comparison | None = None
        self.snapshots: tuple[Snapshot, ...] = ()
        self.in_use: frozenset[int] = frozenset()
        """Numbers of the sets that the controller holds, as far as this program left it."""
        self.running: WriteBack | None = None
        self._answer: asyncio.Future[str] | None = None

    async def compare(self, loaded: Path | None = None) -> None:
        """Read the controller and judge the fit on the Fit screen; nothing is written.

        ``loaded``: a model file that takes the place of that fit.
        """
        station = self._desk.idle_station("compare")
        model = self.model_file() if loaded is None else loaded
        controller = station.controller
        held = await compare_with_known(station.site, controller)
        told = await controller.frame() if isinstance(controller, HostedController) else {}

        def judge() -> Comparison:
            fit = read_fit(model)
            serial = controller.identity.serial
            proposal, checked = judged(station.site, Gates.with_limits({}), fit, held, serial, told)
            return Comparison(model, proposal, tuple(checked), loaded is not None)

        # Arithmetic goes beside the event loop: stop key and drivers must not wait for it.
        self.comparison = await asyncio.to_thread(judge)
        self._desk.picture.gates = []
        for gate in self.comparison.gates:
            self._desk.picture.tell(gate)
        self.list_snapshots(station)

    def model_file(self) -> Path:
        """Write the fit down: what is applied must be there to be read later."""
        answer = self._desk.study.answer
        if answer is None:
            raise BadInput("nothing is fitted yet", remedy="Fit a run on the Fit screen first")
        folder = Path(answer.runs[0])
        inside = folder.name == "run" and (folder.parent / "journal.sqlite").is_file()
        model = (folder.parent if inside else self._desk.root) / "model.toml"
        model.parent.mkdir(parents=True, exist_ok=True)
        from app.files.models import write_model

        write_model(model, answer.fit, self._desk.study.way())
        return model

    async def apply(self) -> None:
        """Write, try on check poses, ask, and keep; or put everything back."""
        station = self._desk.idle_station("apply")
        if self.comparison is None:
            raise GateRefused("nothing is compared yet", remedy="Compare first (c) and look at it")
        fit = read_fit(self.comparison.model)
        self.running = WriteBack(
            station, fit, Gates.with_limits({}), self._desk.root, self._confirm
        )
        self._desk.picture.gates, self._desk.picture.stages = [], []
        try:
            await self._desk.as_job(self.running.run())
        except (StoppedByOperator, GateRefused, DeviceError) as error:
            self._tell_end(error)
            raise
        else:
            self._desk.picture.run = "finished"
            self._desk.course.written()
        finally:
            self.running = None
            self.comparison = None
            self.list_snapshots(station)

    def _tell_end(self, error: Exception) -> None:
        picture = self._desk.picture
        picture.run = "stopped" if isinstance(error, StoppedByOperator) else "fault"
        picture.say_trouble(*end_words([stage.stage for stage in picture.stages], error))

    async def refuse(self) -> None:
        """Raise why nothing can be applied now."""
        self._desk.idle_station("apply")
        if self.comparison is None:
            raise GateRefused("nothing is compared yet", remedy="Compare first (c) and look at it")
        failed = ", ".join(gate.gate for gate in self.comparison.gates if not gate.passed)
        if failed == "gain":
            raise GateRefused(
                "nothing would be gained: what the controller holds is as good as this fit",
                remedy="Nothing was written; more poses, or several runs together (3 o), may do "
                "better",
            )
        raise GateRefused(
            f"gates refuse: {failed}", remedy="Measure more, or fit again; nothing was written"
        )

    async def _confirm(self, proposal: Proposal, before: Summary, after: Summary) -> bool:
        """Ask the person, as the job's other questions are asked."""
        text = (
            f"{len(proposal.changes)} values are on trial. Check poses: peak "
            f"{before.position_peak_um:.1f} -> {after.position_peak_um:.1f} um, RMS "
            f"{before.position_rms_um:.1f} -> {after.position_rms_um:.1f} um. Keep them for good?"
        )
        tell = self._desk.picture.tell
        if self._desk.station is not None:
            self.list_snapshots(self._desk.station)
        self._answer = asyncio.get_running_loop().create_future()
        tell(ev.PromptNeeded(KEEP, text, ("keep", "put back"), "put back"))
        given = ""
        try:
            given = await self._answer
        finally:
            self._answer = None
            tell(ev.PromptAnswered(KEEP, given))
        return given == "keep"

    def answer(self, choice: str) -> None:
        """Answer whether to keep."""
        if self._answer is not None and not self._answer.done():
            self._answer.set_result(choice)

    @property
    def session(self) -> Session | None:
        """The session that measures check poses now, if any."""
        return self.running.running if self.running is not None else None

    @property
    def may_be_cancelled(self) -> bool:
        """Whether a write-back is under way and not already putting things back."""
        stages = self._desk.picture.stages
        return self.running is not None and not (stages and stages[-1].stage == "restore")

    async def undo(self, snapshot: Snapshot) -> None:
        """Bring an earlier set back."""
        station = self._desk.idle_station("undo")
        self._desk.picture.stages = []
        with contextlib.ExitStack() as after:
            after.callback(self.list_snapshots, station)
            await self._desk.as_job(undo(station, snapshot, f"undo to set {snapshot.number}"))
        self.comparison = None
        self._desk.course.undone()
        self._desk.picture.run = "finished"
        self._desk.picture.write(f"set {snapshot.number} is back in the controller", "good")

    async def accept(self) -> None:
        """Take what the controller holds as known."""
        station = self._desk.idle_station("take its parameters as known")
        saved = await accept(station)
        self._desk.picture.trouble = None
        self._desk.picture.write(f"the controller's parameters are known as set {saved.number}")
        self.list_snapshots(station)

    def list_snapshots(self, station: Station) -> None:
        """Look at the sets that there are."""
        known = snapshots_of(station) if station.connected else None
        self.snapshots = tuple(known.all()) if known is not None else ()
        held = known.expected() if known is not None and not known.unknown() else None
        self.in_use = frozenset(
            each.number for each in self.snapshots if held and each.checksum == held.checksum
        )
        self._desk.picture.revision += 1


def end_words(stages: Sequence[str], error: Exception) -> tuple[str, str, Literal["warn", "bad"]]:
    """What a write-back that ended early means for what was written, what to do, and how bad."""
    what, remedy = said(error)
    if isinstance(error, StoppedByOperator):
        what, remedy = "stopped by the operator", ""
    if "write" not in stages:
        return f"Nothing was written: {what}", remedy, "warn"
    if stages[-1] == "restored":
        return f"Not kept: {what}. The earlier parameters are back", remedy, "warn"
    remedy = "Nothing moves until a set is brought back: u on the Apply screen (5)"
    return f"What the controller holds is not known: {what}", remedy, "bad"
