"""Residuals: what a fit leaves, reading by reading, nest by nest, and over the workspace."""

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.content import Content
from textual.widgets import DataTable, Static

from app.show.vector_map import vector_map
from app.tui.face import Face
from app.tui.picture import Picture
from app.tui.reading_lines import NestSummary, ReadingLine, by_nest
from app.tui.widgets.plots import PairPlot
from app.tui.widgets.tables import fill
from calib.identify.readings import MASKED

PLANES = (("from above (x, y)", 0, 1), ("front (x, z)", 0, 2), ("side (y, z)", 1, 2))


class ResidualsFace(Face):
    """Reached from Fit and Discover."""

    mode = "residuals"
    label = "Residuals"
    about = (
        "What the fit leaves of each reading, along the axes of the base: the largest first, by "
        "nest, over the run, and as vectors in the workspace, each drawn from where the SMR was. "
        "m masks the marked reading: it stays in its file and is left out of the next fit, which "
        "f makes; every answer and the record name it. m again takes it back. esc goes back."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#residuals-table"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("m", "mask", "Mask", tooltip="Leave the marked reading out, or take it back"),
        Binding("f", "fit", "Fit again", tooltip="Fit without the masked readings"),
        Binding("w", "order", "Order", tooltip="The largest first, or as they were read"),
        Binding("v", "view", "View", tooltip="Readings, or their pictures, at 80 columns"),
        Binding("p", "plane", "Plane", tooltip="Look at the workspace from another side"),
        Binding("escape", "app.leave_side", "Back", tooltip="Back to where you came from"),
    ]  # fmt: skip

    def __init__(self) -> None:
        super().__init__()
        self._lines: Sequence[ReadingLine] = ()
        self._worst_first = True
        self._plane = 0

    def body(self) -> ComposeResult:
        """Nests and readings to the left, pictures to the right."""
        with Horizontal(id="residuals"):
            with Vertical(id="residuals-left"):
                yield Static(id="residuals-nests", classes="panel")
                yield DataTable(id="residuals-table", cursor_type="row", zebra_stripes=True)
            with Vertical(id="residuals-right"):
                yield PairPlot("Distance from the model, µm, in order", id="residuals-plot")
                yield VectorPanel(id="residuals-map", classes="panel")

    def on_mount(self) -> None:
        """Name the panels."""
        self.query_one("#residuals-nests").border_title = "By nest, µm along the base's axes"
        self.query_one("#residuals-table").border_title = "Readings, µm"

    def show(self, picture: Picture) -> None:
        """Draw everything, but only when the fit, the masks or the view are others."""
        study = self.desk.study
        drawn = (study.answer, study.masked, self._worst_first, self._plane, self.app.size)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        self._lines = () if study.answer is None else study.answer.readings
        self.query_one("#residuals-nests", Static).update(nests_text(by_nest(self._lines)))
        self._fill(study.masked)
        self._draw_pictures()

    def _fill(self, masked: Sequence[str]) -> None:
        table: DataTable[Text] = self.query_one("#residuals-table", DataTable)
        order = self._lines
        if self._worst_first:
            order = sorted(order, key=lambda one: -one.sigmas)
        heads = ("line", "pose", "nest", "x", "y", "z", "3D", "sigmas", "left out")
        rows = [reading_row(one, masked) for one in order]
        fill(table, heads, rows, keys=[one.name for one in order], left=(1, 2, 8), gap=1)
        waits = f"{len(masked)} masked; f fits without them" if masked else "m masks"
        table.border_subtitle = f"{len(rows)} readings; {waits}" if rows else ""

    def _draw_pictures(self) -> None:
        used = [one for one in self._lines if not one.left_out]
        series = {
            nest: (
                np.array([float(one.number) for one in used if one.nest == nest]),
                np.array([one.distance_um for one in used if one.nest == nest]),
            )
            for nest in sorted({one.nest for one in used if one.on_platform})[:5]
        }
        base = [one for one in used if not one.on_platform]
        if base:
            numbers = np.array([float(one.number) for one in base])
            series["base"] = (numbers, np.array([one.distance_um for one in base]))
        self.query_one(PairPlot).show(series, (id(self._lines), len(used)))
        self.query_one(VectorPanel).show(self._lines, self._plane)

    # keys

    def action_mask(self) -> None:
        """Mask the marked reading, or take it back."""
        table = self.query_one("#residuals-table", DataTable)
        if not self._lines or not table.row_count:
            self.notify("Fit a run first (3 f).")
            return
        name = str(table.coordinate_to_cell_key(table.cursor_coordinate).row_key.value)
        left_out = next(one.left_out for one in self._lines if one.name == name)
        if left_out not in ("", MASKED):
            self.notify(f"Line {name} is left out already: {left_out}.")
            return
        self.desk.study.mask(name)

    def action_fit(self) -> None:
        """Fit."""
        self.act(self.desk.study.identify, busy="fitting ...")

    def action_order(self) -> None:
        """Sort the other way."""
        self._worst_first = not self._worst_first
        self.draw()

    def action_view(self) -> None:
        """Show the pictures in place of the table, and back; nothing on a wide screen."""
        self.toggle_class("-pictures")

    def action_plane(self) -> None:
        """Look from the next side."""
        self._plane = (self._plane + 1) % len(PLANES)
        self.draw()


class VectorPanel(Static):
    """Residuals in the workspace, as large as there is room."""

    _lines: Sequence[ReadingLine] = ()
    _plane = PLANES[0]

    def show(self, lines: Sequence[ReadingLine], plane: int) -> None:
        """Draw the readings on the platform that are in the fit, seen from a side."""
        self._lines = [
            one
            for one in lines
            if not one.left_out and one.on_platform and math.isfinite(one.off_um[0])
        ]
        self._plane = PLANES[plane]
        self.border_title = f"Mean residuals in the workspace, {self._plane[0]}"
        self._draw()

    def on_resize(self) -> None:
        """Draw for the new size."""
        self._draw()

    def _draw(self) -> None:
        size, (_, *plane) = self.content_size, self._plane
        if not self._lines or not size.width or not size.height:
            self.update("")
            self.border_subtitle = ""
            return
        places = np.array([one.place_mm for one in self._lines]).T[plane]
        vectors = np.array([one.off_um for one in self._lines]).T[plane]
        drawing = vector_map(places, vectors, size.width, size.height)
        self.update(Content("\n".join(drawing.lines)))
        self.border_subtitle = f"10 signs long: {drawing.ten_signs:.1f} µm"


def nests_text(nests: Sequence[NestSummary]) -> Content:
    """Mean and RMS by axis, one nest a line."""
    if not nests:
        return Content.from_markup("[dim]nothing is fitted yet: 3 f[/]")
    lines = [
        Content.from_markup("[dim]nest    n   mean x      y      z   RMS x      y      z     3D[/]")
    ]
    for one in nests:
        mean = "".join(f"{value:+7.1f}" for value in one.mean_um)
        rms = "".join(f"{value:7.1f}" for value in one.rms_um)
        text = f"{one.nest[:5]:<5}{one.count:4}  {mean} {rms}{one.distance_um:7.1f}"
        lines.append(Content.assemble((text, "bold" if one.nest == "all" else "")))
    return Content("\n").join(lines)


def reading_row(one: ReadingLine, masked: Sequence[str]) -> list[Text]:
    """Cells of one reading; a masked one is marked."""
    why = "masked" if one.name in masked else one.left_out
    if why == MASKED:
        why = "taken back"
    style = "dim" if why else "bold" if one.sigmas > 4.0 else ""
    off = ["-" if math.isnan(value) else f"{value:+.1f}" for value in one.off_um]
    cells = [
        str(one.line), one.pose, one.nest, *off, f"{one.distance_um:.1f}", f"{one.sigmas:.1f}",
        f"– {why}" if why else "",
    ]  # fmt: skip
    return [Text(cell, style) for cell in cells]
