"""The autopilot on the desk: begun, gone on with, asked about, stopped; its journal is true."""

import asyncio
import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from app.auto.decision import Limits
from app.auto.journal import NAME, Decisions
from app.auto.wording import open_words, understood
from app.errors import GateRefused, StoppedByOperator
from app.session import events as ev
from app.session.session import Session
from calib.errors import BadInput
from drivers.errors import DeviceError

if TYPE_CHECKING:
    from app.auto.flight import Flight
    from app.tui.desk import Desk

DECIDE = "decide"
"""Name of the question whether a decision is to be carried out."""


@dataclass(frozen=True)
class FlightWish:
    """What is wanted: um RMS at fresh poses, hours of machine time, poses to begin with."""

    target_um: float
    hours: float | None
    first: int
    apply: bool


class Automatic:
    """What the Auto screen does; it runs as the desk's job.

    The autopilot and its statistics are imported when they are used: the screens open without.
    """

    def __init__(self, desk: "Desk") -> None:
        self._desk = desk
        self.folder: Path | None = None
        self.journal: Decisions | None = None
        self.limits: Limits | None = None
        self.running: Flight | None = None
        self._answer: asyncio.Future[str] | None = None

    def show(self, folder: Path) -> None:
        """Show what was decided in a folder; raises BadInput if its journal is damaged."""
        journal = Decisions(folder)
        begun = journal.begun
        if begun is None:
            raise BadInput(
                "nothing was begun there",
                place=str(folder),
                remedy="Name the folder of an earlier flight, or begin a new one",
            )
        self.folder, self.journal, self.limits = folder, journal, Limits(**begun["limits"])
        self._desk.picture.revision += 1

    async def begin(self, wish: FlightWish) -> None:
        """Begin in a new folder."""
        folder = (self._desk.root / f"auto-{datetime.now():%Y%m%d-%H%M%S}").resolve()
        await self._fly(folder, wish)

    async def go_on(self, folder: Path) -> None:
        """Go on with what was begun in a folder."""
        self.show(folder)
        await self._fly(folder, None)

    async def _fly(self, folder: Path, wish: FlightWish | None) -> None:
        station = self._desk.idle_station("decide by itself")
        from app.auto.flight import Flight, limits_of
        from app.auto.station import StationLaboratory

        limits = (
            limits_of(folder, None, None, 15, apply=True)
            if wish is None
            else limits_of(folder, wish.target_um, wish.hours, wish.first, apply=wish.apply)
        )
        laboratory = StationLaboratory(station, self._desk.root.resolve(), unattended=False)
        flight = Flight(laboratory, folder, limits, ask=self._ask, tell=self._tell)
        self.show(folder)
        self.journal = flight.pilot.journal
        self.running = flight
        self._desk.picture.run = "running"
        try:
            report = await self._desk.as_job(flight.run())
        except (StoppedByOperator, GateRefused, DeviceError, BadInput) as end:
            stopped = isinstance(end, StoppedByOperator)
            self._desk.picture.run = "stopped" if stopped else "fault"
            if stopped:
                self._desk.picture.say_trouble(
                    "Stopped; the machine stands still", "8 g goes on with it", "warn"
                )
            raise
        finally:
            self.running = None
            self._desk.picture.revision += 1
        self._desk.picture.run = "finished"
        self._desk.study.choose(report.runs)
        self._desk.study.effects = report.effects
        for line in open_words(report):
            self._desk.picture.write(line, "warn")
        self._desk.picture.write(report.why, "good" if report.reached else "warn")

    def _tell(self, text: str) -> None:
        self._desk.picture.write(text.strip())

    async def _ask(self, text: str, answers: tuple[str, ...], typed: str) -> str:
        """Ask the person, as the job's other questions are asked."""
        tell = self._desk.picture.tell
        while True:
            self._answer = asyncio.get_running_loop().create_future()
            tell(ev.PromptNeeded(DECIDE, text, answers, None, typed))
            given = ""
            try:
                given = await self._answer
            finally:
                self._answer = None
                tell(ev.PromptAnswered(DECIDE, given))
            if given in answers or understood(typed, given):
                return given
            self._desk.picture.say_trouble(f"{given!r} is no answer", typed, "warn")

    def answer(self, choice: str) -> None:
        """Answer what is asked."""
        if self._answer is not None and not self._answer.done():
            self._answer.set_result(choice)

    @property
    def session(self) -> Session | None:
        """The session that runs now, if any."""
        return self.running.laboratory.running if self.running is not None else None

    @property
    def minutes_wanted(self) -> float | None:
        """The limit of machine time, minutes; None without one."""
        limits = self.limits
        return None if limits is None or math.isinf(limits.minutes) else limits.minutes


def begun_under(root: Path) -> list[Path]:
    """Folders in which something was begun and not decided to its end, the newest first."""
    found = sorted((path.parent for path in root.glob(f"*/{NAME}")), reverse=True)
    return [folder for folder in found if not _ended(folder / NAME)]


def _ended(journal: Path) -> bool:
    """Whether the last decision was to stop; what cannot be read is left to who opens it."""
    lines = journal.read_text(encoding="utf-8", errors="replace").splitlines()
    decided = [line for line in lines if '"event": "decided"' in line]
    return bool(decided) and '"kind": "stop"' in decided[-1]
