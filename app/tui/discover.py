"""Discover: which physical effect is missing; add it and watch the error fall."""

import math
from collections.abc import Collection
from typing import TYPE_CHECKING, Any, ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.widgets import DataTable, Static

from app.show.record_words import remark_lines
from app.show.sizes import size_text
from app.tui.choosing import ask_for_model_file, begin_with_model, choose_runs
from app.tui.dialogs import Pick
from app.tui.face import Face
from app.tui.picture import Picture
from app.tui.widgets.plots import BinPlot
from app.tui.widgets.tables import fill
from app.tui.wording import micro, p_text
from calib.digits import plus_minus

STAIRS, STAIRS_LOW = 4, 3
"""How many of the last steps are shown."""

if TYPE_CHECKING:
    from app.tui.discovering import Search, Stair, View


class DiscoverFace(Face):
    """Compare, diagnose, add, watch the error fall, undo."""

    mode = "discover"
    label = "Discover"
    about = (
        "d asks what the model of the chosen run misses. The candidates stand below, the most "
        "likely first; p pays for having looked at all of them. a adds the marked one, the model "
        "is fitted again and the staircase goes down one step, or the effect is refused because "
        "poses that the fit has not seen speak against it. x takes one out. g goes on by itself. "
        "'Where it fails' says on what the residual depends; v shows the next one as a picture, "
        "or, where there is no room for it, the sizes that are in the model. "
        "What is in the model here is used by Fit and Apply."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#candidates"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("d", "diagnose", "Diagnose", tooltip="Fit the chosen run and ask what is missing"),
        Binding("o", "choose", "Run", tooltip="Choose or type the runs to look at"),
        Binding("a", "add", "Add", tooltip="Put the marked effect into the model"),
        Binding("x", "remove", "Remove", tooltip="Take an effect out of the model"),
        Binding("g", "go_on", "Go on", tooltip="Add by itself what is called for"),
        Binding(
            "v",
            "next",
            "View",
            tooltip="Show the next dependence; at 80 columns what is in the model",
        ),
        Binding(
            "e",
            "app.show_side('residuals')",
            "Residuals",
            show=False,
            tooltip="Reading by reading: what is left, where, and masking by hand",
        ),
        Binding(
            "l", "load", "Load model", show=False, tooltip="Begin with the effects of a model file"
        ),
        Binding("s", "save", "Save", tooltip="Write the model to a file, for fit and apply"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._shown = 0

    def body(self) -> ComposeResult:
        """Staircase and where it fails on top; advice; candidates."""
        with Horizontal(id="discover-top"):
            yield Static(id="stairs", classes="panel")
            yield Static(id="fails", classes="panel")
            yield BinPlot("", id="bins")
        with VerticalScroll(id="advice", classes="panel"):
            yield Static(id="advice-text")
        with Vertical(id="discover-low"):
            yield DataTable(id="candidates", cursor_type="row", zebra_stripes=True)
            with VerticalScroll(id="found", classes="panel", can_focus=False):
                yield Static(id="found-text")

    def on_mount(self) -> None:
        """Name the panels."""
        for name, title in (
            ("stairs", "Staircase, µm"), ("fails", "Where it fails"), ("advice", "Answer"),
            ("candidates", "Candidates"), ("found", "In the model"),
        ):  # fmt: skip
            self.query_one(f"#{name}").border_title = title
        self.query_one("#fails").border_subtitle = "e: reading by reading"

    def show(self, picture: Picture) -> None:
        """Draw everything, but only when the search has moved."""
        search = self.desk.study.search
        view = search.view if search is not None else None
        drawn = (view, self._shown, self.wide, self.low)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        stairs = stairs_text(search, 12 if self.wide else 7, STAIRS_LOW if self.low else STAIRS)
        self.query_one("#stairs", Static).update(stairs)
        self.query_one("#fails", Static).update(fails_text(view, self._shown, self.wide))
        self.query_one("#advice-text", Static).update(advice_text(view))
        self.query_one("#found-text", Static).update(found_text(search))
        self._fill(view)
        if view is not None:
            structure = view.comparison["structure"]
            if structure:
                self.query_one(BinPlot).show(structure[self._shown % len(structure)])

    def _fill(self, view: "View | None") -> None:
        table: DataTable[Text] = self.query_one("#candidates", DataTable)
        table.border_subtitle = ""
        candidates = view.diagnosis["candidates"] if view is not None else []
        shapes = view.shapes if view is not None else frozenset()
        visible = ("visible",) if self.wide else ()
        heads = ("effect", "p", "RMS", "held out", *visible, "largest")
        fill(
            table, heads, [candidate_row(each, shapes, self.wide) for each in candidates],
            keys=[each["effect"] for each in candidates], left=(0, len(heads) - 1), most=44,
            gap=2 if self.wide else 1,
        )  # fmt: skip
        if candidates:
            table.border_subtitle = "RMS and held out: after adding, µm;  a adds"

    # keys

    def action_diagnose(self) -> None:
        """Diagnose the chosen run with the effects that are in the model."""
        self._shown = 0
        self.act(self.desk.study.diagnose, busy="asking what is missing ...")

    def action_choose(self) -> None:
        """Choose a run of the sessions, or type folders."""
        choose_runs(self, self.action_diagnose)

    def action_load(self) -> None:
        """Take the effects of a model file, and ask with them."""
        begin_with_model(self, self.action_diagnose)

    def action_save(self) -> None:
        """Write a model file."""
        ask_for_model_file(self)

    def action_add(self) -> None:
        """Add the marked candidate."""
        table = self.query_one("#candidates", DataTable)
        search = self.desk.study.search
        if search is None or search.view is None or not table.row_count:
            self.notify("Diagnose first (d).")
            return
        name = search.view.diagnosis["candidates"][table.cursor_row]["effect"]
        self.act(lambda: self.desk.study.change("add", name), busy=f"adding {name} ...")

    def action_remove(self) -> None:
        """Choose what to take out."""
        search = self.desk.study.search
        effects = search.view.effects if search is not None and search.view is not None else ()

        def picked(answer: str | None) -> None:
            if answer:
                self.act(
                    lambda: self.desk.study.change("remove", answer), busy=f"removing {answer}"
                )

        if not effects:
            self.notify("There is no effect in the model.")
        elif len(effects) == 1:
            picked(effects[0])
        else:
            options = [(name, name) for name in effects]
            self.app.push_screen(Pick("Remove", "Which effect is to be taken out?", options),
                                 picked)  # fmt: skip

    def action_go_on(self) -> None:
        """Let the program add what is called for."""
        self.act(self.desk.study.go_on, busy="adding what is called for ...")

    def action_next(self) -> None:
        """Show the next dependence; on a narrow screen what is in the model, and back."""
        if self.wide:
            self._shown += 1
            self.draw()
        else:
            self.toggle_class("-model")


NAME, LEGEND = 14, " ░noise █left"
"""Signs of a step's name, where none is longer; what the bars beside it are."""


def stairs_text(search: "Search | None", room: int, most: int) -> Content:
    """The error after the last steps; a bar of ``room`` signs: noise, and what is left."""
    if search is None:
        return Content.from_markup(
            "[bold $ink-accent]d[/] asks what the model of the\nchosen run misses"
        )
    shown = search.stairs[-most:]
    top = max(stair.rms_um for stair in search.stairs)
    # A name is worth more than the bar beside it.
    more = min(max(0, *(len(stair.did) - NAME for stair in shown)), room)
    name, room = NAME + more, room - more
    legend = LEGEND if room >= len(LEGEND) - 1 else ""
    head = f"{'RMS':>{name + 6}} held out{legend}"
    lines = [Content.from_markup("[dim]$head[/]", head=head)]
    for number, stair in enumerate(shown):
        line = f"{_cut(stair.did, name):<{name}}{stair.rms_um:6.2f}{_um(stair.holdout_um)} "
        last = number == len(shown) - 1
        lines.append(Content.assemble((line, "bold" if last else ""), bar(stair, top, room)))
    floor = shown[-1]
    line = f"{'perfect':<{name}}{floor.floor_um:6.2f}{_um(floor.holdout_floor_um)}"
    lines.append(Content.assemble((line, "$ink-success")))
    return Content("\n").join(lines)


def bar(stair: "Stair", top: float, room: int) -> Content:
    """A bar as long as the RMS: the part that a perfect model would leave, and the rest."""
    noise = round(room * min(stair.floor_um, stair.rms_um) / top)
    rest = max(0, round(room * stair.rms_um / top) - noise)
    return Content.assemble(("░" * noise, "dim"), ("█" * rest, "$ink-accent"))


def _um(value: float) -> str:
    return f"{value:9.2f}" if math.isfinite(value) else f"{'-':>9}"


def _cut(text: str, room: int) -> str:
    return text if len(text) <= room else text[: room - 1] + "…"


def fails_text(view: "View | None", shown: int, wide: bool) -> Content:
    """What the residual depends on, the strongest first; ``shown`` is the one in the picture."""
    if view is None:
        return Content("")
    structure = view.comparison["structure"]
    lines = []
    for number, each in enumerate(structure[: 12 if wide else 5]):
        sign, style = ("!", "$ink-warning") if each["significant"] else ("·", "dim")
        period = f", period {each['period']:.3g}" if each["period"] else ""
        mark = "▸" if wide and number == shown % len(structure) else " "
        p = f"  p {p_text(each['p_value'])}" if wide else ""
        name = _cut(each["channel"] + period, 20)
        lines.append(
            Content.assemble(
                (f"{mark}{sign} ", style), f"{name:<20}{each['explains_um']:5.1f} µm", (p, "dim")
            )
        )
    repeats = view.comparison["repeatability"]
    if repeats is not None:
        lines.append(Content(f"   repeats within {repeats['times_stated_sigma']:.2f} sigma"))
    return Content("\n").join(lines)


def advice_text(view: "View | None") -> Content:
    """The answer in one sentence, and what cannot be told apart."""
    if view is None:
        return Content("")
    diagnosis = view.diagnosis
    mark = ("✓ ", "$ink-success") if diagnosis["adequate"] else ("! ", "$ink-warning")
    told = [
        said for said in remark_lines(diagnosis) if said.split(". ")[0] not in diagnosis["advice"]
    ]
    first = [(f"{micro(said)}\n", "$ink-warning") for said in told]
    which = " (e: which)" if diagnosis["bad_readings"] else ""
    text = Content.assemble(*first, mark, micro(diagnosis["advice"]), which)
    for group in diagnosis["indistinguishable"]:
        if all(name in diagnosis["advice"] for name in group):
            continue  # the answer says so itself
        text = Content.assemble(text, ("  Cannot be told apart: ", "bold"), ", ".join(group), ".")
    return text


def found_text(search: "Search | None") -> Content:
    """Effects in the model: how each was called for, its sizes, what it may be instead."""
    view = search.view if search is not None else None
    if search is None or view is None or not view.effects:
        return Content.from_markup("[dim]geometry only[/]")
    came = {stair.did.removeprefix("+ "): stair for stair in search.stairs}
    lines = []
    for effect in view.effects:
        stair = came.get(effect)
        lines.append(Content.assemble((effect, "bold"), (_called(stair), "dim")))
        stem = f"{effect}."
        own = {
            each["name"].removeprefix(stem): size_text(each, sign="±")
            for each in view.parameters
            if each["name"].startswith(stem)
        }
        longest = max(map(len, own), default=0)
        lines += [Content(f"  {name:<{longest}} {size}") for name, size in own.items()]
        lines += [Content.assemble((f"  ! {doubt}", "$ink-warning")) for doubt in _doubts(stair)]
    return Content("\n").join(lines)


def _doubts(stair: "Stair | None") -> list[str]:
    if stair is None:
        return []
    rivals = [f"or {', '.join(stair.rivals)}?"] if stair.rivals else []
    return rivals + (["weak: chance does so, too"] if stair.weak else [])


def _called(stair: "Stair | None") -> str:
    return "" if stair is None or stair.p_value is None else f"  p {p_text(stair.p_value)}"


def candidate_row(candidate: dict[str, Any], shapes: Collection[str], wide: bool) -> list[Text]:
    """Cells of one candidate; the size is that of its largest unknown, by its name."""
    likely = candidate["p_value"] < 0.05
    style = "bold" if likely else "dim"
    held = candidate["holdout_rms_after_um"]
    cells = [
        ("! " if likely else "  ") + candidate["effect"],
        p_text(candidate["p_value"]),
        f"{candidate['rms_after_um']:.2f}" if candidate["rms_after_um"] is not None else "-",
        f"{held:.2f}" if held is not None else "-",
        *([f"{100 * candidate['visible']:.0f} %"] if wide else []),
        largest_text(candidate, shapes) if likely else "",
    ]
    return [Text(cell, style) for cell in cells]


def largest_text(candidate: dict[str, Any], shapes: Collection[str]) -> str:
    """``leg4 -0.00042 ± 0.00018 mm/N (+5)``: the size that is most sigmas from zero."""
    sizes = [p for p in candidate["parameters"] if p["name"] not in shapes]
    if not sizes:
        return ""
    one = max(sizes, key=lambda p: abs(p["value"]) / p["sigma"] if p["sigma"] else 0.0)
    name = one["name"].removeprefix(f"{candidate['effect']}.")
    more = f" (+{len(sizes) - 1})" if len(sizes) > 1 else ""
    return f"{name} {plus_minus(one['value'], one['sigma'], one['unit'], sign='±')}{more}"
