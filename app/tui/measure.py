"""Measure: the step list, what machine and tracker (or gauge) do now, the residuals growing."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.content import Content
from textual.widgets import Static

from app.files.site import Site
from app.session.events import NumberTaken
from app.session.facts import facts_of
from app.tui.dialogs import Pick
from app.tui.face import Face
from app.tui.machine_view import MachineView
from app.tui.picture import Picture
from app.tui.planning import NewRun, RunWish, plan_for
from app.tui.shelf import unfinished
from app.tui.starting import session_words
from app.tui.widgets.plots import MissPlot, ScatterPlot
from app.tui.widgets.steplist import StepList
from calib.digits import plus_minus
from calib.mechanism.axes import Axis


class MeasureFace(Face):
    """Where the operator spends the day."""

    mode = "measure"
    label = "Measure"
    about = (
        "Choose a plan and start it (n). Left, the steps: the one in work is marked. Right, what "
        "machine and tracker do now, and the distance of every reading from its prediction: it "
        "should look like a cloud, not like a staircase. The job asks when an SMR is to be "
        "carried. After a stop or a fault, g goes on where it ended: nothing is measured twice."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("n", "new", "New run", tooltip="Choose poses and start measuring"),
        Binding("space", "pause", "Pause", tooltip="Hold after the step in work, or go on"),
        Binding("k", "skip", "Skip", tooltip="Leave the step in work out"),
        Binding("g", "go_on", "Go on with", tooltip="Go on with a session that ended early"),
    ]

    def body(self) -> ComposeResult:
        """Steps to the left, the present to the right."""
        with Horizontal(id="measure"):
            yield StepList(id="steps")
            with Vertical(id="measure-right"):
                yield Static(id="now", classes="panel")
                yield MissPlot("Readings: distance from prediction, µm", id="miss")
                with Horizontal(id="measure-low"):
                    yield ScatterPlot("Scatter while settling, µm", id="scatter")
                    yield MachineView(id="machine")

    def on_mount(self) -> None:
        """Name the panel."""
        self.query_one("#now").border_title = "Now"

    def show(self, picture: Picture) -> None:
        """Draw list, status and plots."""
        steps = self.query_one(StepList)
        steps.show(picture.steps, picture.current)
        done = sum(step.state in ("done", "skipped") for step in picture.steps)
        steps.border_subtitle = f"{done} of {len(picture.steps)}" if picture.steps else ""
        axes = self.desk.site.machine.axes if self.desk.site is not None else ()
        self.query_one("#now", Static).update(now_text(picture, self.wide, axes))
        base = self.desk.site.base_nests if self.desk.site else ()
        self.query_one(MissPlot).show(picture.points, base)
        if self.wide and not self.low:
            self.query_one(MachineView).show(self.desk.site, picture)
        scatter = picture.scatter
        if scatter:
            self.query_one(ScatterPlot).show(
                [each.std_mm for each in scatter], scatter[-1].limit_mm, picture.revision
            )

    # keys

    def action_new(self) -> None:
        """Choose what to measure and start."""
        site = self.desk.site
        if site is None or not self.desk.connected or self.desk.busy:
            self.act(self._refuse)
            return

        def chosen(wish: RunWish | None) -> None:
            if wish is not None:
                self.act(lambda: self._measure(site, wish), busy="choosing poses ...")

        self.app.push_screen(NewRun(site), chosen)

    async def _refuse(self) -> None:
        self.desk.idle_station("start a run")

    async def _measure(self, site: Site, wish: RunWish) -> None:
        await self.desk.run(await plan_for(site, wish))

    def action_pause(self) -> None:
        """Hold, or go on."""

        async def toggle() -> None:
            self.desk.pause_or_resume()

        self.act(toggle)

    def action_skip(self) -> None:
        """Leave the step in work out."""

        async def skip() -> None:
            self.desk.skip()

        self.act(skip)

    def action_go_on(self) -> None:
        """Choose among the sessions that can be gone on with."""
        folders = unfinished(self.desk.root)
        if not folders:
            self.notify(f"No session in {self.desk.root} ended early.")
            return

        def picked(answer: str | None) -> None:
            if answer:
                self.act(lambda: self.desk.go_on(Path(answer)))

        options = [(str(folder), session_words(facts_of(folder))) for folder in folders]
        self.app.push_screen(Pick("Go on with", "Sessions, newest first", options), picked)


def now_text(picture: Picture, wide: bool, axes: Sequence[Axis]) -> Content:
    """Six lines that keep their places: step, pose, q, scatter, reading, base and drift.

    Actuators that turn a joint are shown in degrees, all others in their own unit.
    """
    if not picture.steps:
        return Content.from_markup(
            "No job.  [bold $ink-accent]n[/] starts a new run,\n"
            "[bold $ink-accent]g[/] goes on with one that ended early."
        )
    rows = [
        ("step", _step(picture)),
        ("pose", _pose(picture, wide)),
        ("q", _actuators(picture, wide, axes)),
        ("noise", _scatter(picture)),
        ("read", _reading(picture)),
        ("base", _base(picture)),
    ]
    return Content("\n").join(Content.assemble((f"{name:<6}", "dim"), text) for name, text in rows)


def _step(picture: Picture) -> Content:
    if picture.current is None:
        return Content("-")
    step = picture.steps[picture.current]
    again = f"  (attempt {picture.attempt})" if picture.attempt > 1 else ""
    return Content.assemble((step.says, "bold"), again)


def _pose(picture: Picture, wide: bool) -> Content:
    if picture.pose is None:
        return Content("-")
    x, y, z, *angles = picture.pose.pose
    turns = [f"{math.degrees(angle):.{2 if wide else 0}f}" for angle in angles]
    if wide:
        return Content(f"{x:8.2f} {y:8.2f} {z:8.2f} mm   {'  '.join(turns)} deg")
    return Content(f"{x:.1f} {y:.1f} {z:.1f} mm {' '.join(turns)}°")


def _actuators(picture: Picture, wide: bool, axes: Sequence[Axis]) -> Content:
    live = picture.live
    q = live.q if live is not None else picture.pose.q if picture.pose is not None else None
    if q is None:
        return Content("-")
    sign = "▶" if live is not None and live.moving else " "
    digits = 3 if wide else 1
    turning = {number for number, axis in enumerate(axes) if axis.moves == "rad"}
    shown = [
        f"{math.degrees(x):.{digits + 1}f}°" if number in turning else f"{x:.{digits}f}"
        for number, x in enumerate(q)
    ]
    return Content(sign + ("  " if wide else " ").join(shown))


def _scatter(picture: Picture) -> Content:
    last = picture.settling
    if last is None:
        return Content("-")
    filled = min(8, round(8 * last.std_mm / last.limit_mm)) if last.limit_mm > 0 else 8
    bar = "█" * filled + "░" * (8 - filled)
    word = ("settled", "$ink-success") if last.settled else ("settling", "$ink-warning")
    return Content.assemble(
        f"{bar} {last.std_mm * 1000:.1f} of {last.limit_mm * 1000:.0f} µm  ", word
    )


def _reading(picture: Picture) -> Content:
    if picture.last_number is not None:
        return _number(picture, picture.last_number)
    last = picture.last_reading
    if last is None:
        return Content("-")
    aside = f", {picture.rejected} set aside" if picture.rejected else ""
    if picture.last_rough:
        return Content(f"nest {last.nest}: to find the base by{aside}")
    miss = plus_minus(last.miss_mm * 1000, last.sigma_mm * 1000, "µm", sign="±")
    return Content(f"nest {last.nest}: off by {miss}{aside}")


def _number(picture: Picture, last: NumberTaken) -> Content:
    aside = f", {picture.rejected} set aside" if picture.rejected else ""
    unit = "µm" if last.unit == "mm" else "mrad"
    off = plus_minus((last.value - last.expected) * 1000, last.sigma * 1000, unit, sign="±")
    shown = f"{last.value:.4f} mm" if last.unit == "mm" else f"{math.degrees(last.value):.4f} deg"
    to = f" to {last.nest2}" if last.nest2 else ""
    return Content(f"{last.nest}{to}: {shown}, off by {off}{aside}")


def _base(picture: Picture) -> Content:
    if picture.last_number is not None:
        if picture.drift is None:
            return Content("zero: not looked at again yet")
        shift, limit = picture.drift.shift_mm * 1000, picture.drift.limit_mm * 1000
        return Content(f"zero moved {shift:.1f}/{limit:.0f} µm")
    if picture.frame is None:
        return Content("not found yet")
    text = f"found, RMS {picture.frame.rms_mm * 1000:.1f}"
    if picture.drift is not None:
        text += f", drift {picture.drift.shift_mm * 1000:.1f}/{picture.drift.limit_mm * 1000:.0f}"
    return Content(text + " µm")
