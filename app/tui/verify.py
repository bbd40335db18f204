"""Verify: how far the machine is from where it is sent, before and after, pose by pose."""

from pathlib import Path
from typing import ClassVar

import numpy as np
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.content import Content
from textual.widgets import DataTable, Static

from app.session.facts import facts_of
from app.show.spans import duration
from app.tui.choosing import ask_for_file
from app.tui.dialogs import Choose, Pick
from app.tui.face import Face
from app.tui.picture import Picture
from app.tui.shelf import finished_verifications
from app.tui.starting import session_words
from app.tui.verifying import Verified, one_in_eight
from app.tui.widgets.plots import LogPairPlot
from app.tui.widgets.tables import fill
from app.verification import PAPER
from calib.arrays import Array
from calib.pose_error import Summary
from calib.poses.verification import unit_grid

RECORD_ENDINGS = (".html", ".pdf")
ALL, QUICK = "all poses", "quick"


class VerifyFace(Face):
    """The proof."""

    mode = "verify"
    label = "Verify"
    about = (
        "v sends the machine over a grid of poses that no fit has seen and measures where it "
        "goes; nothing is fitted and nothing is written. The last verification stands as 'after', "
        "the last one before something was written as 'before'; o chooses another. A perfect "
        "machine would show what the tracker's noise alone shows. On a mock the noise-free truth "
        "stands beside it."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#verify-table"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "verify", "Verify", tooltip="Measure the verification poses"),
        Binding("o", "before", "Before", tooltip="Choose an earlier verification"),
        Binding("p", "record", "Record", tooltip="Write the calibration record, HTML and PDF"),
        Binding(
            "h",
            "app.show_side('history')",
            "History",
            tooltip="What became of this machine: sets, fits, verifications, drifts",
        ),
        Binding("w", "worst", "Worst first", tooltip="Sort by the error, or by the path"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._worst_first = False

    def body(self) -> ComposeResult:
        """Summary on top, poses below, the picture beside them where there is room."""
        yield Static(id="verify-summary", classes="panel")
        with Horizontal(id="verify"):
            yield DataTable(id="verify-table", cursor_type="row", zebra_stripes=True)
            with Vertical(id="verify-plots"):
                yield LogPairPlot("Position error, µm, pose by pose", id="verify-position")
                yield LogPairPlot("Orientation error, mdeg, pose by pose", id="verify-angle")

    def on_mount(self) -> None:
        """Name the panels."""
        self.query_one("#verify-summary").border_title = "Verification"
        self.query_one("#verify-table").border_title = "Poses"

    def show(self, picture: Picture) -> None:
        """Draw summary, table and plots; the latter only when there is news."""
        before, after = self.desk.course.before, self.desk.course.after
        self.query_one("#verify-summary", Static).update(
            summary_text(before, after, running_text(picture))
        )
        drawn = (before, after, self._worst_first, self.wide)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        self._fill(before, after)
        for which, name in ((0, "position"), (1, "angle")):
            plot = self.query_one(f"#verify-{name}", LogPairPlot)
            plot.show(aligned(before, after, which), (id(before), id(after)))

    def _fill(self, before: Verified | None, after: Verified | None) -> None:
        table = self.query_one("#verify-table", DataTable)
        shown = [v for v in (before, after) if v is not None]
        names = ["before µm", "after µm", "before mdeg", "after mdeg"]
        if len(shown) < 2:
            names = ["µm", "mdeg"]
        if not shown:
            fill(table, ("pose", *names), ())
            return
        labels = list(shown[-1].found.labels)
        by_label = [dict(zip(v.found.labels, v.errors.T, strict=True)) for v in shown]
        if self._worst_first:
            labels.sort(key=lambda label: -float(by_label[-1][label][0]))
        rows = []
        for label in labels:
            cells = [
                f"{one[label][which]:.1f}" if label in one else "-"
                for which in (0, 1)
                for one in by_label
            ]
            rows.append([label, *cells])
        fill(table, ("pose", *names), rows)
        table.border_subtitle = (
            f"{len(labels)} poses, {'worst first' if self._worst_first else 'in order of path'}"
        )

    # keys

    def action_verify(self) -> None:
        """Choose how many poses, and go."""
        site = self.desk.site
        if site is None or not self.desk.connected or self.desk.busy:
            self.act(self._refuse)
            return

        def chosen(answer: str | None) -> None:
            if answer:
                quick = answer == QUICK
                self.act(lambda: self.desk.verify(quick), busy="choosing verification poses ...")

        smrs = site.hands.smrs
        nests = len(site.platform_nests)
        carried = f", one SMR carried into {nests} nests" if smrs < nests else ""
        labels = list(unit_grid(site.machine)[0])
        few = len(one_in_eight(labels))
        text = (
            f"The machine will visit a grid of {len(labels)} poses, quick: {few} of them{carried}. "
            "Nothing is written to it. Progress is on the Measure screen (2)."
        )
        self.app.push_screen(Choose("Verify", text, (ALL, QUICK)), chosen)

    async def _refuse(self) -> None:
        self.desk.idle_station("verify")

    def action_before(self) -> None:
        """Choose what stands as 'before'."""
        found = finished_verifications(self.desk.root)
        if not found:
            self.notify(f"No finished verification in {self.desk.root}.")
            return

        def picked(answer: str | None) -> None:
            if answer:
                self.act(lambda: self.desk.course.load_before(Path(answer)))

        options = [(str(folder), session_words(facts_of(folder))) for folder in found]
        self.app.push_screen(Pick("Before", "Finished verifications, newest first", options),
                             picked)  # fmt: skip

    def action_record(self) -> None:
        """Ask for the file, and write the record there as HTML and as pages."""
        if self.desk.study.answer is None:
            self.notify("Fit a run first (3 f): the record says what was found.")
            return

        def write(out: Path) -> None:
            outs = [out.with_suffix(ending) for ending in RECORD_ENDINGS]

            async def written() -> None:
                await self.desk.write_record(outs)
                self.notify(f"{' and '.join(map(str, outs))}", title="Calibration record")

            self.act(written, busy="writing the record ...")

        text = "File for the calibration record; it is written as .html and .pdf"
        ask_for_file(self, "Calibration record", text, "record", write, RECORD_ENDINGS)

    def action_worst(self) -> None:
        """Sort the other way."""
        self._worst_first = not self._worst_first
        self.draw()


def aligned(
    before: Verified | None, after: Verified | None, which: int
) -> dict[str, tuple[Array, Array]]:
    """Errors over the number of the pose: where both visited a pose, both stand at one place."""
    shown = [(n, v) for n, v in (("before", before), ("after", after)) if v is not None]
    places: dict[str, float] = {}
    for _, one in sorted(shown, key=lambda each: -len(each[1].found.labels)):
        for label in one.found.labels:
            places.setdefault(label, float(len(places) + 1))
    alone = len(shown) == 1
    return {
        "measured" if alone else name: (
            np.array([places[label] for label in one.found.labels]), one.errors[which],
        )
        for name, one in shown
    }  # fmt: skip


def running_text(picture: Picture) -> str:
    """How far a verification has come that runs now; empty if none does."""
    if not picture.busy or picture.purpose != "verify":
        return ""
    done = picture.progress
    if done is None:
        return "a verification begins; 2 shows its steps"
    left = f", {duration(done.remaining_s)} left" if done.remaining_s is not None else ""
    return f"a verification runs: step {done.done} of {done.total}{left}; 2 shows its steps"


def summary_text(before: Verified | None, after: Verified | None, running: str = "") -> Content:
    """Peaks and standard deviations, before and after, with what they can be compared to."""
    if before is None and after is None:
        if running:
            return Content.assemble(("▶ ", "$ink-accent"), running)
        return Content.from_markup("[bold $ink-accent]v[/] measures where the machine goes.")
    lines = [
        Content.assemble(("▶ ", "$ink-accent"), running)
        if running
        else Content.from_markup(
            "[dim]                      peak µm   std µm  peak mdeg  std mdeg[/]"
        )
    ]
    for when, verified in (("before", before), ("after", after)):
        if verified is None:
            continue
        name = f"{when}, " if before is not None and after is not None else ""
        lines.append(_line(f"{name}measured", verified.found.measured, bold=when == "after"))
        if verified.found.truth is not None:
            lines.append(_line(f"{name}true (mock)", verified.found.truth))
    last = after or before
    assert last is not None
    found = last.found
    lines.append(Content(_row("tracker noise alone", found.noise_peak_um, found.noise_peak_deg)))
    if found.truth is not None:  # a mock: what was published of such a machine
        paper = _row("Han et al. 2020", PAPER["position_peak_um"], PAPER["orientation_peak_deg"])
        lines.append(Content.assemble((f"{paper}            measured, after", "dim")))
    return Content("\n").join(lines)


def _row(name: str, peak_um: float, peak_deg: float) -> str:
    return f"{name:<20}{peak_um:9.1f}{'':9}{1e3 * peak_deg:11.1f}"


def _line(name: str, found: Summary, *, bold: bool = False) -> Content:
    text = (
        f"{name:<20}{found.position_peak_um:9.1f}{found.position_std_um:9.1f}"
        f"{1e3 * found.orientation_peak_deg:11.1f}{1e3 * found.orientation_std_deg:10.1f}"
    )
    return Content.assemble((text, "bold" if bold else ""))
