"""Auto: the autopilot; what is wanted, what it decides and why, and the person's say in it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, VerticalScroll
from textual.content import Content
from textual.widgets import Static

from app.auto.decision import Decision
from app.auto.wording import decision_of, found_words, gained
from app.tui.automatic import Automatic, FlightWish, begun_under
from app.tui.dialogs import Pick
from app.tui.face import Face
from app.tui.picture import Picture
from app.tui.planning import NewFlight
from app.tui.widgets.plots import TargetPlot
from app.tui.wording import micro

BAR = 30
"""Signs of a bar; the target stands in its middle."""


class AutoFace(Face):
    """The laboratory that decides by itself."""

    mode = "auto"
    label = "Auto"
    about = (
        "n says which accuracy is wanted at fresh poses, and what may be spent. Then the program "
        "measures, looks for what is missing, measures for what cannot be told apart, writes "
        "through the gates and verifies, until the target holds. Before each decision it asks "
        "you: go on, skip it, choose another, or stop. Every decision is on the disk before it is "
        "carried out; after a stop, a fault or a crash g goes on with it."
    )
    AUTO_FOCUS: ClassVar[str | None] = "#auto-decisions"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("n", "new", "New", tooltip="Say what is wanted, and begin"),
        Binding("g", "go_on", "Go on with", tooltip="Go on with one that ended early"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._drawn: tuple[object, ...] | None = None

    def body(self) -> ComposeResult:
        """The goal and the present decision on top, those so far and the picture below."""
        yield Static(id="auto-goal", classes="panel")
        yield Static(id="auto-now", classes="panel")
        with Horizontal(id="auto-low"):
            with VerticalScroll(id="auto-decisions", classes="panel"):
                yield Static(id="auto-decisions-text")
            yield TargetPlot("Predicted and seen, µm, over poses", id="auto-plot")

    def on_mount(self) -> None:
        """Name the panels."""
        for name, title in (("goal", "Target"), ("now", "Now"), ("decisions", "Decided")):
            self.query_one(f"#auto-{name}").border_title = title

    def show(self, picture: Picture) -> None:
        """Draw goal and present; the rest when the journal has grown."""
        flight = self.desk.automatic
        lines: Sequence[Mapping[str, Any]] = flight.journal.lines if flight.journal else ()
        self.query_one("#auto-goal", Static).update(goal_text(flight, lines))
        self.query_one("#auto-now", Static).update(now_text(flight, lines, picture))
        drawn = (flight.folder, len(lines), self.wide)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        self.query_one("#auto-decisions-text", Static).update(decided_text(lines))
        folder = flight.folder.name if flight.folder is not None else ""
        self.query_one("#auto-decisions").border_subtitle = folder
        target = flight.limits.target_um if flight.limits is not None else None
        self.query_one(TargetPlot).show(series(lines), target, drawn)

    # keys

    def action_new(self) -> None:
        """Ask what is wanted, and begin."""
        if self.desk.site is None or not self.desk.connected or self.desk.busy:
            self.act(self._refuse)
            return

        def wanted(wish: FlightWish | None) -> None:
            if wish is not None:
                self.act(lambda: self.desk.automatic.begin(wish), busy="begins ...")

        self.app.push_screen(NewFlight(), wanted)

    async def _refuse(self) -> None:
        self.desk.idle_station("decide by itself")

    def action_go_on(self) -> None:
        """Choose among those that were not decided to their ends."""
        folders = begun_under(self.desk.root)
        if not folders:
            self.notify(f"Nothing in {self.desk.root} was begun and ended early.")
            return

        def picked(answer: str | None) -> None:
            if answer:
                self.act(lambda: self.desk.automatic.go_on(Path(answer).resolve()))

        options = [(str(folder), folder.name) for folder in folders]
        self.app.push_screen(Pick("Go on with", "Begun, newest first", options), picked)


def of(lines: Sequence[Mapping[str, Any]], event: str) -> list[Mapping[str, Any]]:
    """The lines of one event, in order."""
    return [line for line in lines if line["event"] == event]


def goal_text(flight: Automatic, lines: Sequence[Mapping[str, Any]]) -> Content:
    """What is wanted and spent; prediction and proof beside the target; what was found."""
    limits = flight.limits
    if limits is None:
        return Content.from_markup(
            "[bold $ink-accent]n[/] says which accuracy is wanted, and begins;\n"
            "[bold $ink-accent]g[/] goes on with one that ended early."
        )
    done, found = of(lines, "done"), of(lines, "found")
    poses = sum(int(line.get("poses", 0)) for line in done)
    minutes = sum(float(line.get("minutes", 0.0)) for line in done)
    of_all = "" if flight.minutes_wanted is None else f" of {flight.minutes_wanted / 60:.1f} h"
    writes = "" if limits.apply else "; nothing is written"
    seen = [line for line in done if "verified_um" in line]
    shown = [
        Content.assemble(
            (f"{limits.target_um:g} µm RMS", "bold"), " are wanted at fresh poses;  ",
            f"{poses} poses, {minutes / 60:.1f} h{of_all} spent{writes}",
        ),
        _against("predicted", found[-1]["predicted_um"] if found else None, limits.target_um),
        _against("fresh poses", seen[-1]["verified_um"] if seen else None, limits.target_um,
                 f"95 %: at most {seen[-1]['at_most_um']:.1f}" if seen else ""),
        Content(micro(found_words(found[-1]) if found else "")),
    ]  # fmt: skip
    return Content("\n").join(shown)


def _against(name: str, value: float | None, target: float, more: str = "") -> Content:
    """A bar as long as a value, the target marked in its middle."""
    if value is None:
        return Content.assemble((f"{name:<12}", "dim"), "    -")
    filled = min(BAR, round(BAR * value / (2.0 * target)))
    signs = ["█"] * filled + ["·"] * (BAR - filled)
    signs[BAR // 2] = "┃"
    style = "$ink-success" if value <= target else "$ink-warning"
    mark = "✓" if value <= target else "!"
    return Content.assemble(
        (f"{name:<12}", "dim"), f"{value:7.1f} µm ", ("".join(signs), style), f" {mark}  {more}"
    )


def now_text(flight: Automatic, lines: Sequence[Mapping[str, Any]], picture: Picture) -> Content:
    """The last decision, its reason, what is expected of it, and what is done about it."""
    decided = of(lines, "decided")
    if not decided:
        return Content(_doing(flight, picture, ended=False))
    number, last = decided[-1]["number"], decision_of(decided[-1])
    ended = any(line["number"] == number for line in of(lines, "done"))
    return Content("\n").join(
        [
            Content.assemble((f"{number}  {does(last)}", "bold")),
            Content(micro(last.why)),
            Content.assemble((micro(gained(last)), "dim")),
            Content(_doing(flight, picture, ended=ended and last.kind == "stop")),
        ]
    )


def _doing(flight: Automatic, picture: Picture, *, ended: bool) -> str:
    if flight.running is None:
        return "" if flight.journal is None else "✓ ended" if ended else "■ stands; g goes on"
    if picture.prompt is not None:
        return "? asks you: r replies"
    if flight.session is not None and picture.steps:
        done = sum(step.state in ("done", "skipped") for step in picture.steps)
        step = "" if picture.current is None else f": {picture.steps[picture.current].says}"
        return f"▶ {done} of {len(picture.steps)} steps{step}"
    if flight.running.laboratory.moves:
        return f"▶ {picture.stages[-1].says}" if picture.stages else "▶ at work"
    return "… computes"


def does(decision: Decision) -> str:
    """What a decision does; of a stop, whether the target holds."""
    if decision.kind == "stop":
        if decision.reached is None:
            return "stop: nothing is to be written"
        return f"stop: the target {'holds' if decision.reached else 'is not reached'}"
    return decision.words()


def decided_text(lines: Sequence[Mapping[str, Any]]) -> Content:
    """Every decision with what came of it, the last one first."""
    blocks: list[list[Content]] = []
    for line in lines:
        match line["event"]:
            case "decided":
                head = Content.assemble(
                    (f"{line['number']}  {does(decision_of(line))}", "bold"),
                    (f"   {micro(line['why'])}", "dim"),
                )
                blocks.append([head])
            case "done" if blocks and _came(line):
                sign = ("– ", "$ink-warning") if line.get("vetoed") else ("✓ ", "$ink-success")
                blocks[-1].append(Content.assemble("   ", sign, _came(line)))
            case "found" if blocks:
                blocks[-1].append(Content(f"   {micro(found_words(line))}"))
    if not blocks:
        return Content.from_markup("[dim]nothing yet[/]")
    return Content("\n").join(part for block in reversed(blocks) for part in block)


def _came(line: Mapping[str, Any]) -> str:
    if "run" in line:
        session = Path(line["run"]).parent.name
        return f"{line['poses']} poses in {line['minutes']:.0f} min of machine time: {session}"
    return micro(str(line.get("says", "")))


def series(
    lines: Sequence[Mapping[str, Any]],
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """What was predicted and what fresh poses have shown, over the poses measured by then."""
    poses = 0.0
    points: dict[str, list[tuple[float, float]]] = {"predicted": [], "fresh poses": []}
    for line in lines:
        poses += float(line.get("poses", 0))
        if line["event"] == "found":
            points["predicted"].append((poses, line["predicted_um"]))
        elif "verified_um" in line:
            points["fresh poses"].append((poses, line["verified_um"]))
    return {
        name: (np.array([x for x, _ in xy]), np.array([y for _, y in xy]))
        for name, xy in points.items()
    }
