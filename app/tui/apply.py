"""Apply: what would be written, what the gates say, write and try, keep or put back, undo."""

import math
from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.widgets import DataTable, Static

from app.session.events import GateChecked
from app.session.known import Snapshot
from app.tui.choosing import choose_model
from app.tui.correction import Comparison
from app.tui.dialogs import Choose, Pick
from app.tui.face import Face
from app.tui.picture import Picture
from app.tui.widgets.tables import fill
from app.writeback.proposal import Change
from calib.digits import Digits, fixed


class LatestInSight(VerticalScroll):
    """Shows its end also when something else, a banner, has taken room from it."""

    def on_resize(self) -> None:
        """Go to the end."""
        self.call_after_refresh(self.scroll_end, animate=False)


class ApplyFace(Face):
    """Writing corrections to the controller, with the way back always open."""

    mode = "apply"
    label = "Apply"
    about = (
        "c compares the fit with what the controller holds and asks the gates; nothing is written. "
        "l compares a model file instead, one of an earlier day for instance. "
        "a writes to volatile memory, reads back bit for bit, measures check poses before and "
        "after, asks you, and only then stores. Any failure, and the stop key, puts the earlier "
        "set back. u brings back any earlier set. t takes what the controller holds as known, "
        "where it is not what this program left there."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#apply-table"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("c", "compare", "Compare", tooltip="Compare fit and controller; ask the gates"),
        Binding(
            "l", "load", "Load model", tooltip="Compare a model file with the controller instead"
        ),
        Binding("a", "apply", "Apply", tooltip="Write, try on check poses, then keep or put back"),
        Binding("u", "undo", "Undo", tooltip="Bring back an earlier parameter set"),
        Binding("t", "accept", "Take as known", tooltip="Accept what the controller holds now"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._stages = 0

    def body(self) -> ComposeResult:
        """Changes to the left; gates, stages and snapshots to the right."""
        with Horizontal(id="apply"):
            yield DataTable(id="apply-table", cursor_type="row", zebra_stripes=True)
            with Vertical(id="apply-right"):
                with VerticalScroll(id="apply-gates", classes="panel"):
                    yield Static(id="apply-gates-text")
                with LatestInSight(id="apply-stages", classes="panel"):
                    yield Static(id="apply-stages-text")
                yield Static(id="apply-sets", classes="panel")

    def on_mount(self) -> None:
        """Name the panels."""
        for name, title in (
            ("table", "Old and new"), ("gates", "Gates"), ("stages", "Write-back"),
            ("sets", "Parameter sets"),
        ):  # fmt: skip
            self.query_one(f"#apply-{name}").border_title = title

    def show(self, picture: Picture) -> None:
        """Draw table, gates and stages."""
        corrections = self.desk.corrections
        comparison = corrections.comparison
        gates = gates_text(picture.gates, wide=self.wide, brief=self.low and bool(picture.stages))
        self.query_one("#apply-gates-text", Static).update(gates)
        left_out = comparison.proposal.left_out if comparison is not None else {}
        self.query_one("#apply-stages-text", Static).update(stages_text(picture, left_out))
        if len(picture.stages) != self._stages:
            self._stages = len(picture.stages)
            stages = self.query_one("#apply-stages", VerticalScroll)
            self.call_after_refresh(stages.scroll_end, animate=False)
        self.query_one("#apply-sets", Static).update(
            sets_text(corrections.snapshots, corrections.in_use)
        )
        drawn = (comparison, self.wide, self.desk.study.answer)
        if drawn != self._drawn:
            self._drawn = drawn
            self._fill(comparison)

    def _fill(self, comparison: Comparison | None) -> None:
        table: DataTable[Text] = self.query_one("#apply-table", DataTable)
        table.border_subtitle = ""
        if comparison is None:
            fitted = self.desk.study.answer is not None
            said = "c compares the fit with the controller"
            fill(table, ("",), ((said if fitted else "Nothing is fitted yet: go to Fit (3)",),))
            return
        changes = comparison.proposal.changes
        old = ("old",) if self.wide else ()
        site = self.desk.site
        geometry = site.machine.parameter_index if site is not None else ()
        rows = rows_of(grouped(changes, geometry), self.wide)
        fill(
            table,
            ("name", *old, "new", "change", "sigmas"),
            rows,
            most=22,
            gap=2 if self.wide else 1,
        )
        whose = f" of {comparison.model}" if comparison.loaded else ""
        table.border_subtitle = f"{len(changes)} values{whose} in mm, rad; largest first"

    # keys

    def action_compare(self) -> None:
        """Compare."""
        self.act(self.desk.corrections.compare, busy="comparing fit and controller ...")

    def action_load(self) -> None:
        """Choose a model file and compare it."""

        def compare(model: Path) -> None:
            busy = f"comparing {model} and controller ..."
            self.act(lambda: self.desk.corrections.compare(model), busy=busy)

        choose_model(self, compare)

    def action_apply(self) -> None:
        """Ask once more, then write."""
        comparison = self.desk.corrections.comparison
        if comparison is None or not comparison.passed:
            self.act(self._refuse)
            return

        def sure(answer: str | None) -> None:
            if answer == "apply":
                self.act(self.desk.corrections.apply, busy="write-back begins ...")

        text = (
            f"{len(comparison.proposal.changes)} values go to volatile memory, the machine visits "
            "the check poses twice, and you are asked again before anything is kept. Nobody in "
            "the machine?"
        )
        self.app.push_screen(Choose("Apply?", text, ("apply", "not now"), first="not now"), sure)

    async def _refuse(self) -> None:
        await self.desk.corrections.refuse()

    def action_undo(self) -> None:
        """Choose an earlier set and bring it back."""

        async def look() -> None:
            station = self.desk.idle_station("undo")
            self.desk.corrections.list_snapshots(station)
            sets = self.desk.corrections.snapshots
            if not sets:
                self.notify("There is no earlier set of this controller.")
                return
            held = self.desk.corrections.in_use
            options = [
                (str(each.number), set_line(each, each.number in held)) for each in reversed(sets)
            ]
            self.app.push_screen(
                Pick("Undo", "Which set is to be brought back, for good?", options), picked
            )

        def picked(answer: str | None) -> None:
            for snapshot in self.desk.corrections.snapshots:
                if answer == str(snapshot.number):
                    self.act(partial(self.desk.corrections.undo, snapshot))

        self.act(look)

    def action_accept(self) -> None:
        """Ask, then accept."""

        def sure(answer: str | None) -> None:
            if answer == "take as known":
                self.act(self.desk.corrections.accept)

        text = (
            "The controller's parameters become the known ones, whatever they are. Do this only "
            "if you know who wrote them."
        )
        choices = ("take as known", "leave")
        self.app.push_screen(Choose("Take as known?", text, choices, first="leave"), sure)


def grouped(changes: Sequence[Change], geometry: Collection[str]) -> dict[str, list[Change]]:
    """The geometry (""), then effect by effect; in each the largest in its uncertainties first."""
    groups: dict[str, list[Change]] = {}
    for change in changes:
        whose = "" if change.name in geometry else change.name.partition(".")[0]
        groups.setdefault(whose, []).append(change)
    return {whose: sorted(group, key=_by_size) for whose, group in groups.items()}


def _by_size(change: Change) -> float:
    """Largest first; one without an uncertainty before all others: nobody knows how large it is."""
    return -abs(change.in_sigmas) if math.isfinite(change.in_sigmas) else -math.inf


def rows_of(groups: Mapping[str, Sequence[Change]], wide: bool) -> list[list[Text]]:
    """Cells of the changes, an effect's name above its own; what is not determined is dim."""
    rows = []
    for whose, group in groups.items():
        if whose:
            rows.append([Text(whose, "bold"), *(Text() for _ in range(4 if wide else 3))])
        for change in group:
            digits = Digits.of(change.sigma, change.old, change.new)
            name = f" {change.name.removeprefix(f'{whose}.')}" if whose else change.name
            cells = [name] + ([digits.text(change.old)] if wide else [])
            cells += [digits.text(change.new), digits.text(change.new - change.old, signed=True)]
            cells.append(fixed(change.in_sigmas, 1, signed=True))
            rows.append([Text(cell, "" if change.identified else "dim") for cell in cells])
    return rows


def gates_text(gates: Sequence[GateChecked], *, wide: bool, brief: bool) -> Content:
    """Each gate with its value against its limit, those that refuse first and with their reason.

    ``brief``: gates that passed are only named, for what follows them needs the room.
    """
    if not gates:
        return Content.from_markup("[dim]not asked yet[/]")
    refused = [gate for gate in gates if not gate.passed]
    passed = [gate for gate in gates if gate.passed]
    lines = []
    for gate in refused:
        lines.append(Content.assemble(("✗ ", "bold $ink-error"), _numbers(gate)))
        lines.append(Content(f"  {_reason(gate)}"))
    if brief and passed:
        names = ", ".join(gate.gate for gate in passed)
        lines.append(Content.assemble(("✓ ", "$ink-success"), f"passed: {names}"))
        return Content("\n").join(lines)
    for gate in passed:
        reason = f" {_reason(gate)}" if wide else ""
        lines.append(Content.assemble(("✓ ", "$ink-success"), _numbers(gate), (reason, "dim")))
    return Content("\n").join(lines)


def _numbers(gate: GateChecked) -> str:
    sign = "≤" if gate.passed else ">" if gate.value > gate.limit else "not ≤"
    return f"{gate.gate:<11}{gate.value:7.3g} {sign} {f'{gate.limit:g} {gate.unit}':<6}"


def _reason(gate: GateChecked) -> str:
    return gate.says.removeprefix(f"{gate.gate}: ").rpartition(": ")[0]


def stages_text(picture: Picture, left_out: Mapping[str, str]) -> Content:
    """The stages so far; the last one is the present one while the job runs."""
    if not picture.stages:
        lines = [Content.from_markup("[dim]nothing written[/]")]
        for name, why in left_out.items():
            text = Content.assemble((f"– {name} ", "$ink-warning"), f"will not be: {why}")
            lines.append(text)
        return Content("\n").join(lines)
    lines = []
    for number, stage in enumerate(picture.stages):
        last = number == len(picture.stages) - 1
        bad = stage.stage in ("restore", "restore-failed")
        sign = "✗" if bad else "▶" if last and picture.busy else "✓"
        style = "bold $ink-error" if bad else "$ink-accent" if sign == "▶" else "$ink-success"
        lines.append(Content.assemble((f"{sign} ", style), stage.says))
    return Content("\n").join(lines)


def sets_text(snapshots: tuple[Snapshot, ...], held: Collection[int]) -> Content:
    """The latest parameter sets, newest first; ``held`` are those that the controller holds."""
    if not snapshots:
        return Content.from_markup("[dim]none yet[/]")
    return Content("\n").join(
        Content(set_line(each, each.number in held)) for each in reversed(snapshots[-12:])
    )


def set_line(snapshot: Snapshot, held: bool) -> str:
    """One parameter set in a line, with a sign if the controller holds it."""
    when = snapshot.taken_utc.replace("T", " ").removesuffix("+00:00")
    mark = "▶" if held else " "
    now = "  (in the controller)" if held else ""
    return f"{mark}{snapshot.number:>3}  {when}  {snapshot.why}{now}"
