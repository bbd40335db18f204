"""An automatic calibration from its limits to its report, for verbs, scripts and screens alike."""

import asyncio
import math
import os
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from app.auto.autopilot import Ask, Autopilot, Tell
from app.auto.decision import Limits
from app.auto.journal import NAME
from app.auto.report import report_of
from app.auto.station import StationLaboratory
from app.defaults import FEWEST_FIRST, MOST_FIRST
from app.errors import StoppedByOperator
from app.jobs.automatic import AutoReport
from calib.errors import BadInput


def limits_of(
    folder: Path, target_um: float | None, hours: float | None, first: int, *, apply: bool
) -> Limits:
    """What is wanted; of a folder in which something was begun, what was wanted then.

    Raises
    ------
    BadInput
        Without a target, and for numbers that make no sense.
    """
    if target_um is None and not (folder / NAME).exists():
        raise BadInput("no target", remedy="Say the accuracy that is wanted: --target-um 8")
    for name, value in (("target_um", target_um), ("hours", hours)):
        if value is not None and not 0.0 < value < math.inf:
            raise BadInput(f"{name} is {value:g}", remedy="Give a positive number")
    if not FEWEST_FIRST <= first <= MOST_FIRST:
        raise BadInput(
            f"{first} poses to begin with", remedy=f"Give {FEWEST_FIRST} to {MOST_FIRST}"
        )
    return Limits(target_um or 1.0, math.inf if hours is None else 60.0 * hours, first, apply)


def folder_of(out: str | os.PathLike[str] | None) -> Path:
    """Where the journal is kept: what was said, else a name by the clock."""
    return Path(f"auto-{datetime.now():%Y%m%d-%H%M%S}" if out is None else out).resolve()


class Flight:
    """One automatic calibration on a station, to its end or until it is stopped.

    Parameters
    ----------
    laboratory : StationLaboratory
        Its sessions get folders where it was told.
    folder : Path
        Of the journal; one in which something was begun is gone on with.
    limits, seed, ask, tell
        As for :class:`Autopilot`.

    Raises
    ------
    BadInput
        If the folder cannot be made, or its journal is damaged.
    """

    def __init__(
        self,
        laboratory: StationLaboratory,
        folder: Path,
        limits: Limits,
        seed: int = 1,
        ask: Ask | None = None,
        tell: Tell = lambda _: None,
    ) -> None:
        self.laboratory, self.folder = laboratory, folder
        folder.mkdir(parents=True, exist_ok=True)
        self.pilot = Autopilot(folder, laboratory, limits, seed, ask, tell)
        self._task: asyncio.Task[AutoReport] | None = None
        self._stopped = False

    async def run(self) -> AutoReport:
        """Decide and do until a decision says stop.

        Raises
        ------
        StoppedByOperator
            After :meth:`stop`, or where the person said stop; the same folder is gone on with.
        BadInput, DeviceError, GateRefused
            As sessions and write-backs raise them.
        """
        self._task = asyncio.create_task(self._run(), name="automatic calibration")
        try:
            return await self._task
        except asyncio.CancelledError:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
            if self._stopped:
                raise StoppedByOperator(remedy=f"Go on with the folder {self.folder}") from None
            raise

    async def _run(self) -> AutoReport:
        return report_of(self.pilot, await self.pilot.run(), self.folder)

    async def stop(self) -> None:
        """Stop now: motion first, if anything moves; else what is computed or asked."""
        self._stopped = True
        if self.laboratory.moves:
            await self.laboratory.stop()
        elif self._task is not None:
            self._task.cancel()
