"""History: every parameter of a machine over time, what changed, and where it drifts."""

from datetime import datetime
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.widgets import DataTable, Static

from app.report.history_words import drift_words
from app.report.words import with_uncertainty
from app.show.clocks import clock
from app.tui.face import Face
from app.tui.history_view import series_of
from app.tui.picture import Picture
from app.tui.widgets.plots import SeriesPlot
from app.tui.widgets.tables import fill
from app.tui.wording import micro, p_text

if TYPE_CHECKING:
    from app.jobs.looking_back import MachineEntry, SeriesEntry

DAY_S = 86400.0


class HistoryFace(Face):
    """Reached by h from Devices and Verify."""

    mode = "history"
    label = "History"
    about = (
        "What became of a machine: every set that was applied, every fit and verification of the "
        "sessions in this folder. A parameter is marked where the last calibration differs from "
        "the one before more than chance, paid for over all of them, or where it drifts; the "
        "marked line is drawn over time with its uncertainty. n shows the next machine."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#history-table"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("n", "next", "Next machine", tooltip="Show the next machine of this folder"),
        Binding("v", "view", "View", tooltip="Parameters, or the picture, at 80 columns"),
        Binding("f", "refresh", "Read anew", tooltip="Read the history again"),
        Binding("escape", "app.leave_side", "Back", tooltip="Back to where you came from"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._series: list[SeriesEntry] = []

    def body(self) -> ComposeResult:
        """Events and parameters to the left, the picture to the right."""
        with Horizontal(id="history"):
            with Vertical(id="history-left"):
                with VerticalScroll(id="history-events", classes="panel", can_focus=False):
                    yield Static(id="history-events-text")
                yield DataTable(id="history-table", cursor_type="row", zebra_stripes=True)
            with Vertical(id="history-right"):
                yield SeriesPlot("", id="history-plot")
                yield Static(id="history-words", classes="panel")

    def on_mount(self) -> None:
        """Name the panels."""
        self.query_one("#history-table").border_title = "Parameters, the last calibration"
        self.query_one("#history-words").border_title = "What is to be expected"

    def on_screen_resume(self) -> None:
        """Read the history each time the screen is shown: another program may have added to it."""
        super().on_screen_resume()
        self.action_refresh()

    def show(self, picture: Picture) -> None:
        """Draw everything, but only when the history or the machine is another."""
        past = self.desk.past
        drawn = (past.found, past.place, self.app.size)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        machine = past.machine
        self._series = series_of(machine)
        events = self.query_one("#history-events", VerticalScroll)
        number, count = past.place
        name = f"{machine.machine} {machine.serial}".strip() if machine is not None else ""
        events.border_title = name or "No machine"
        events.border_subtitle = f"{number} of {count}; n: the next" if count > 1 else ""
        self.query_one("#history-events-text", Static).update(events_text(machine))
        table: DataTable[Text] = self.query_one("#history-table", DataTable)
        heads = ("parameter", "before", "now", "change", "±", "p", "unit")
        rows = [series_row(one) for one in self._series]
        gap = 2 if self.wide else 1
        fill(table, heads, rows, left=(0, len(heads) - 1), most=24, gap=gap)
        table.border_subtitle = told(self._series)
        self._draw_marked()

    def on_data_table_row_highlighted(self) -> None:
        """Draw the series of the marked line."""
        self._draw_marked()

    def _draw_marked(self) -> None:
        row = self.query_one("#history-table", DataTable).cursor_row
        if not 0 <= row < len(self._series):
            self.query_one("#history-words", Static).update("")
            return
        one = self._series[row]
        moments = [datetime.fromisoformat(utc).timestamp() for utc in one.utc]
        days = np.array([(moment - moments[-1]) / DAY_S for moment in moments])
        plot = self.query_one(SeriesPlot)
        plot.show(one.name, one.unit, days, np.array(one.values), np.array(one.sigmas), id(one))
        self.query_one("#history-words", Static).update(words_of(one))

    # keys

    def action_next(self) -> None:
        """Show the next machine."""
        self.desk.past.next_machine()

    def action_view(self) -> None:
        """Show the picture in place of the table, and back; nothing on a wide screen."""
        self.toggle_class("-pictures")

    def action_refresh(self) -> None:
        """Read the history again."""
        self.act(self.desk.look_back)


def events_text(machine: "MachineEntry | None") -> Content:
    """What happened, the newest first."""
    if machine is None:
        return Content.from_markup("[dim]nothing was applied, fitted or verified here yet[/]")
    signs = {"applied": "▶", "fit": "·", "verification": "✓"}
    return Content("\n").join(
        Content.assemble((f"{clock(event.utc)}  ", "dim"),
                         f"{signs.get(event.kind, ' ')} {event.kind:<12}  {micro(event.says)}")
        for event in reversed(machine.events)
    )  # fmt: skip


def series_row(one: "SeriesEntry") -> list[Text]:
    """Cells of one parameter; what changed or drifts is marked by a sign."""
    changed = one.changed or (one.drift is not None and one.drift.clear)
    style = "bold" if changed else "dim"
    now, _ = with_uncertainty(one.values[-1], one.sigmas[-1])
    cells = [("! " if changed else "  ") + one.name, "", now, "", "", "", micro(one.unit)]
    if one.change is not None and one.change_sigma is not None and one.p_value is not None:
        change, sigma = with_uncertainty(one.change, one.change_sigma)
        before, _ = with_uncertainty(one.values[-2], one.sigmas[-2])
        cells[1], cells[3:6] = before, [change, sigma, p_text(one.p_value)]
    return [Text(cell, style) for cell in cells]


def told(series: "list[SeriesEntry]") -> str:
    """How many calibrations there are, and how many parameters changed."""
    count = max((len(one.values) for one in series), default=0)
    changed = sum(one.changed for one in series)
    if count < 2:
        return "one calibration: nothing to compare with" if count else ""
    return f"{count} calibrations; {changed} changed more than chance"


def words_of(one: "SeriesEntry") -> Content:
    """What is known of a series, in a sentence or two."""
    unit = f" {one.unit}" if one.unit else ""
    now, sigma = with_uncertainty(one.values[-1], one.sigmas[-1])
    lines = [f"{one.name}: {now} ± {sigma}{unit}, {clock(one.utc[-1])}"]
    if one.p_value is not None:
        said = "changed more than chance" if one.changed else "no more than chance"
        lines.append(f"since the calibration before: {said} (p {p_text(one.p_value)})")
    if one.drift is None:
        lines.append("a drift is looked for from three calibrations on, over a day or more")
    else:
        sign = "moves" if one.drift.clear else "no drift beyond chance:"
        lines.append(f"{sign} {drift_words(one.drift, one.unit)}".replace("+-", "±"))
    return Content(micro("\n".join(lines)))
