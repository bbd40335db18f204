"""The study of what was measured: which runs, which effects, the fit, the discovery.

What needs the engine is imported when it is used: the screens open without it.
"""

import asyncio
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

from app.errors import GateRefused
from app.files.staircase import StairStep, Way
from app.tui.picture import Picture
from app.tui.shelf import runs_under
from calib.errors import BadInput

if TYPE_CHECKING:
    from app.tui.analysis import FitAnswer
    from app.tui.discovering import Search

_Answer = TypeVar("_Answer")


class Study:
    """What the Fit and the Discover screen share; runs are read and never written to."""

    def __init__(self, root: Path, picture: Picture) -> None:
        self._root = root
        self._picture = picture
        self._thinking = False
        self.runs: tuple[str, ...] = ()
        self.effects: tuple[str, ...] = ()
        self.masked: tuple[str, ...] = ()
        """Lines of readings that the operator leaves out, as ``--mask`` takes them."""
        self.answer: FitAnswer | None = None
        self.search: Search | None = None
        self.offers: tuple[Path, ...] = ()
        """Effect files of the site: candidates beside the catalogue."""
        self.model: Path | None = None
        """The model file that the effects were taken from, for those that are its own."""

    def choose(self, runs: tuple[str, ...]) -> None:
        """Study other runs; what was found in the last ones is put aside."""
        if self.runs and runs != self.runs:
            self.answer = self.search = None
            self.effects = self.masked = ()
            self.model = None
        self.runs = runs
        self._picture.revision += 1

    async def begin_with(self, model: Path) -> None:
        """Take the effects of a model file; the next fit and question begin with them.

        Raises
        ------
        BadInput
            If it cannot be read.
        """
        from app.files.fits import read_fit

        saved = await asyncio.to_thread(read_fit, model)
        self.answer = self.search = None
        self.model, self.effects = model, saved.effects
        names = ", ".join(saved.effects) or "none"
        self._picture.write(f"effects of {model}: {names}", "good")

    def mask(self, line: str) -> None:
        """Leave a reading out of the next fit, or take it back; it stays in its file.

        The staircase begins anew with the next question: its steps are of other readings.
        """
        back = line in self.masked
        self.masked = (
            tuple(one for one in self.masked if one != line) if back else (*self.masked, line)
        )
        self.search = None
        self._picture.write(f"line {line} {'taken back' if back else 'masked'}; f fits anew")

    def _chosen(self) -> tuple[str, ...]:
        if not self.runs:
            latest = runs_under(self._root)
            if not latest:
                remedy = "Measure one, or choose a folder (o)"
                if self._picture.busy and self._picture.purpose == "measure":
                    remedy = "Wait until the measurement that runs is finished"
                raise BadInput("there is no run yet", remedy=remedy)
            self.choose((str(latest[0]),))
        return self.runs

    async def _think(self, what: Callable[[], _Answer]) -> _Answer:
        """Do arithmetic beside the event loop: stop key and drivers must not wait for it."""
        if self._thinking:
            raise GateRefused("still busy with the last question", remedy="Wait for its answer")
        self._thinking = True
        try:
            return await asyncio.to_thread(what)
        finally:
            self._thinking = False

    async def identify(self) -> None:
        """Fit the chosen runs, or the latest; raises :class:`BadInput`."""
        runs = self._chosen()
        effects, masked, offers, model = self.effects, self.masked, self.offers, self.model

        def work() -> "FitAnswer":
            from app.tui.analysis import OwnEffects, identify

            return identify(runs, effects, masked, OwnEffects(offers, model))

        self._take(await self._think(work))

    def _take(self, answer: "FitAnswer") -> None:
        self.answer = answer
        report = answer.report
        self._picture.write(
            f"fitted {report['readings']} readings: RMS {answer.before_um:.1f} -> "
            f"{report['rms_um']:.1f} um, floor {report['noise_floor_um']:.1f}",
            "good",
        )

    async def diagnose(self) -> None:
        """Ask what the model of the chosen runs misses, with the effects that are in it."""
        runs = self._chosen()
        effects, masked, offers, model = self.effects, self.masked, self.offers, self.model
        before = self.search.stairs if self.search is not None else []

        def work() -> "tuple[Search, FitAnswer]":
            from app.tui.analysis import OwnEffects, answer_of
            from app.tui.discovering import Search

            found = Search.of(runs, effects, OwnEffects(offers, model), masked)
            if before:  # asked again: the way so far stands
                found.stairs[:] = [*before, *(s for s in found.stairs[1:] if s not in before)]
            return found, answer_of(runs, found.present.run.fit)

        search, answer = await self._think(work)
        self._take(answer)
        self.search = search
        self._tell_stair(search)

    async def change(self, what: Literal["add", "remove", "go on"], name: str = "") -> None:
        """Add or remove an effect, or go on by itself; the fit is then that of the new model."""
        search = self.search
        if search is None:
            raise BadInput("nothing is diagnosed yet", remedy="Diagnose first (d)")

        def work() -> "FitAnswer":
            from app.tui.analysis import answer_of

            if what == "add":
                search.add(name)
            elif what == "remove":
                search.remove(name)
            else:
                search.go_on()
            return answer_of(search.runs, search.present.run.fit)

        self._take(await self._think(work))
        self.effects = search.present.effects
        self._tell_stair(search)

    async def go_on(self) -> None:
        """Add by itself what is called for; what was not asked yet is asked first."""
        if self.search is None:
            await self.diagnose()
        await self.change("go on")

    def _tell_stair(self, search: "Search") -> None:
        stair = search.stairs[-1]
        self._picture.write(
            f"{stair.did}: RMS {stair.rms_um:.2f} um, floor {stair.floor_um:.2f}", "good"
        )

    def way(self) -> Way:
        """How the model was found, for its file."""
        if self.search is None:
            return Way()
        steps = [
            StairStep(
                did=stair.did, chi2_per_dof=stair.chi2_per_dof, rms_um=stair.rms_um,
                noise_floor_um=stair.floor_um, holdout_rms_um=_known(stair.holdout_um),
                holdout_floor_um=_known(stair.holdout_floor_um), p_value=stair.p_value,
                weak=stair.weak, rivals=stair.rivals,
            )
            for stair in self.search.stairs
        ]  # fmt: skip
        view = self.search.view
        groups = () if view is None else view.diagnosis["indistinguishable"]
        return Way(tuple(steps), tuple(tuple(group) for group in groups))

    async def save(self, path: Path) -> None:
        """Write the fitted model to a file; with the ending of a picture, the staircase."""
        if self.answer is None:
            raise BadInput("nothing is fitted yet", remedy="Fit a run first")
        if path.suffix.lower() in PICTURES:
            await self._draw_staircase(path)
            return
        from app.files.models import write_model

        write_model(path, self.answer.fit, self.way())
        self._picture.write(f"model written to {path}", "good")

    async def _draw_staircase(self, path: Path) -> None:
        way = self.way()
        if not way.steps:
            raise BadInput("there is no staircase yet", remedy="Ask on the Discover screen (4 d)")

        def draw() -> None:
            from app.report.findings import staircase_figure
            from app.show.charts import save

            save(staircase_figure(way)[0], path)

        await asyncio.to_thread(draw)
        self._picture.write(f"staircase drawn in {path}", "good")


PICTURES = (".svg", ".png", ".pdf")


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
