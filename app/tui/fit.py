"""Fit: identify the parameters from a run, see what they are worth and what stays open."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.widgets import DataTable, Static

from app.show.record_words import excluded_lines, remark_lines
from app.tui.choosing import ask_for_model_file, begin_with_model, choose_runs
from app.tui.face import Face
from app.tui.picture import Picture
from app.tui.widgets.plots import PairPlot
from app.tui.widgets.tables import fill
from app.tui.wording import micro
from calib.digits import Digits, fixed
from calib.discover.agreement import DOUBTED

if TYPE_CHECKING:
    from app.tui.analysis import FitAnswer


class FitFace(Face):
    """What the readings say about the machine."""

    mode = "fit"
    label = "Fit"
    about = (
        "f fits the latest run. The RMS should fall to the floor, which is what a perfect model "
        "would leave; chi-square per degree of freedom should be near 1. Held-out poses tell what "
        "the model is worth where nothing was measured. 'open' marks a parameter that these "
        "readings do not determine: it stays near its drawing value and does no harm. tab goes "
        "into the table, arrows scroll it."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#fit-table"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("f", "fit", "Fit", tooltip="Fit the run that is chosen, or the latest"),
        Binding("o", "choose", "Run", tooltip="Choose or type the runs to fit"),
        Binding(
            "e",
            "app.show_side('residuals')",
            "Residuals",
            tooltip="Reading by reading: what is left, where, and masking by hand",
        ),
        Binding("l", "load", "Load model", tooltip="Fit with the effects of a model file"),
        Binding("s", "save", "Save model", tooltip="Write what was found to a model file"),
    ]

    def __init__(self) -> None:
        super().__init__()

    def body(self) -> ComposeResult:
        """Summary to the left, parameters to the right."""
        with Horizontal(id="fit"):
            with Vertical(id="fit-left"):
                yield Static(id="fit-summary", classes="panel")
                with VerticalScroll(id="fit-open", classes="panel"):
                    yield Static(id="fit-words")
            with Vertical(id="fit-right"):
                yield DataTable(id="fit-table", cursor_type="row", zebra_stripes=True)
                yield PairPlot("Readings: distance from the model, µm", id="fit-plot")

    def on_mount(self) -> None:
        """Name the panels."""
        self.query_one("#fit-summary").border_title = "Fit"
        self.query_one("#fit-open").border_title = "What to know"
        self.query_one("#fit-table").border_title = "Parameters"

    def show(self, picture: Picture) -> None:
        """Draw the answer; the table only when it is another one."""
        answer = self.desk.study.answer
        self.query_one("#fit-summary", Static).update(summary(answer, self.desk.study.runs))
        if (answer, self.wide) == self._drawn:
            return
        self._drawn = answer, self.wide
        self.query_one("#fit-words", Static).update(words(answer))
        if answer is not None:
            self._fill(answer)
            numbers = np.arange(1.0, len(answer.miss_before) + 1.0)
            self.query_one(PairPlot).show(
                {
                    "drawing": (numbers, answer.miss_before * 1000.0),
                    "fitted": (numbers, answer.miss_after * 1000.0),
                },
                id(answer),
            )

    def _fill(self, answer: "FitAnswer") -> None:
        table = self.query_one("#fit-table", DataTable)
        value = ("value",) if self.wide else ()
        heads = ("parameter", *value, "change", "±", "sigmas", "")
        rows = [parameter_row(entry, self.wide) for entry in answer.report["parameters"]]
        fill(table, heads, rows, left=(0, len(heads) - 1))
        known = sum(entry["identified"] for entry in answer.report["parameters"])
        table.border_subtitle = f"{known} of {len(rows)} determined; mm, rad"

    # keys

    def action_fit(self) -> None:
        """Fit."""
        self.act(self.desk.study.identify, busy="fitting ...")

    def action_choose(self) -> None:
        """Choose a run of the sessions, or type folders."""
        choose_runs(self, self.action_fit)

    def action_load(self) -> None:
        """Take the effects of a model file, and fit with them."""
        begin_with_model(self, self.action_fit)

    def action_save(self) -> None:
        """Write a model file."""
        ask_for_model_file(self)


def summary(answer: "FitAnswer | None", runs: tuple[str, ...]) -> Content:
    """Before and after, in a few lines that keep their places."""
    if answer is None:
        which = f"Run: {_short(runs)}\n" if runs else ""
        return Content.from_markup(
            which
            + "[bold $ink-accent]f[/] fits the latest run\n[bold $ink-accent]o[/] chooses another"
        )
    report = answer.report
    effects = ", ".join(report["effects"]) or "geometry only"
    bad = len(report["bad_readings"])
    lines = [
        Content.assemble(("run      ", "dim"), _short(answer.runs)),
        Content.assemble(("model    ", "dim"), effects),
        Content.assemble(("readings ", "dim"), f"{report['readings']}, {bad} excluded"),
        Content.from_markup("[dim]RMS, µm            floor[/]"),
        Content(f"drawing {answer.before_um:9.1f}"),
        Content.assemble(
            "fitted  ", (f"{report['rms_um']:9.1f}", "bold"), f" {report['noise_floor_um']:6.1f}"
        ),
        Content.assemble(
            "held out", (_number(report["holdout_rms_um"], 9), "bold"),
            f" {_number(report['holdout_floor_um'], 6)}",
        ),
        Content.assemble(
            "chi²/dof", (_number(report["chi2_per_dof"], 9, 2), "bold"), f"  {verdict(report)}"
        ),
    ]  # fmt: skip
    return Content("\n").join(lines)


def verdict(report: dict[str, Any]) -> str:
    """Say in a word whether the model explains the readings, by the odds of chance."""
    by_chance = report["p_value"]
    if by_chance is None:
        return "too few"
    if by_chance < DOUBTED:
        return "! too much"
    return "✓ good" if by_chance < 1.0 - DOUBTED else "! too little"


def words(answer: "FitAnswer | None") -> Content:
    """What is not determined, which readings are excluded, what else to know."""
    if answer is None:
        return Content("")
    report = answer.report
    parts: list[Content] = [
        Content.from_markup("[$ink-warning]![/] $said", said=micro(said))
        for said in remark_lines(report)
    ]
    parts += [
        Content.from_markup("[$ink-warning]![/] $said", said=micro(said))
        for said in report["remarks"]
    ]
    parts += [
        Content.from_markup("[$ink-warning]✗[/] $told", told=told)
        for told in excluded_lines(report)
    ]
    if report["left_out_readings"]:
        parts.append(
            Content(
                f"{report['left_out_readings']} readings lack a channel or [load] of an effect."
            )
        )
    groups = list(zip(report["unidentified"], report["unidentified_words"], strict=True))
    parts += [Content(f"{sentence}.") for group, sentence in groups if len(group) > 1]
    alone = [group[0] for group, _ in groups if len(group) == 1]
    if alone:
        which = f"{len(alone)} parameters are" if len(alone) > 1 else "One parameter is"
        parts.append(
            Content.assemble(
                f"{which} not seen by these readings and kept near the drawing: ",
                (", ".join(alone), "dim"),
            )
        )
    if not parts:
        parts = [Content.from_markup("[$ink-success]✓[/] Nothing is left open.")]
    return Content("\n").join(parts)


def parameter_row(entry: dict[str, Any], wide: bool) -> list[Text]:
    """Cells of one parameter."""
    nominal, sigma = entry["nominal"], entry["sigma"]
    change = None if nominal is None else entry["value"] - nominal
    ratio = "" if change is None or not sigma else fixed(change / sigma, 1, signed=True)
    digits = Digits.of(sigma, entry["value"])
    cells = [entry["name"], digits.text(entry["value"])] if wide else [entry["name"]]
    cells += ["" if change is None else digits.text(change, signed=True)]
    cells += [digits.text(sigma), ratio]
    style = "" if entry["identified"] else "dim"
    row = [Text(cell, style) for cell in cells]
    return [*row, Text("" if entry["identified"] else "open", "bold")]


def _number(value: float | None, width: int, digits: int = 1) -> str:
    return f"{value:{width}.{digits}f}" if value is not None else f"{'-':>{width}}"


def _short(runs: tuple[str, ...]) -> str:
    """Name runs: the session's folder where the run lies in one."""
    names = [Path(run).parent.name if Path(run).name == "run" else Path(run).name for run in runs]
    return ", ".join(names)
