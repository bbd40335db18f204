"""The demo on a terminal: a line a step, and the table at the end."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from app.demo.job import STEPS, Outcome, Watcher
from app.verification import PAPER
from calib.pose_error import Summary


class DemoScreen:
    """Shows which step is under way, how far it is and what it gave."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._part: dict[str, float] = {}
        self._said: dict[str, str] = {}
        self._began: dict[str, float] = {}
        self._took: dict[str, float] = {}
        self._live: Live | None = None
        self.watcher = Watcher(self._begin, self._advance, self._end)

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Keep the list on the terminal meanwhile; without a terminal, print a line a step."""
        if not self._console.is_terminal:
            yield
            return
        with Live(self._list(), console=self._console, refresh_per_second=4) as live:
            self._live = live
            yield
            live.update(self._list())
            self._live = None

    def _begin(self, step: str) -> None:
        self._began[step] = monotonic()
        self._part[step] = 0.0
        self._refresh()

    def _advance(self, step: str, part: float) -> None:
        self._part[step] = part
        self._refresh()

    def _end(self, step: str, said: str) -> None:
        self._took[step] = monotonic() - self._began[step]
        self._said[step] = said
        self._refresh()
        if self._live is None:
            self._console.print(f"{dict(STEPS)[step]} [{self._took[step]:.1f} s]", markup=False)
            self._console.print(f"    {said}", markup=False)

    def _refresh(self) -> None:
        if self._live is not None:
            self._live.update(self._list())

    def _list(self) -> RenderableType:
        grid = Table.grid(padding=(0, 1), expand=True)
        grid.add_column(width=1)
        grid.add_column(ratio=1, overflow="fold")
        grid.add_column(width=7, justify="right")
        for step, says in STEPS:
            if step in self._said:
                grid.add_row(
                    "✓", f"{says}\n  [dim]{self._said[step]}[/dim]", f"{self._took[step]:.1f} s"
                )
            elif step in self._part:
                bar = ProgressBar(total=1.0, completed=self._part[step], width=40)
                grid.add_row("▶", f"[bold]{says}[/bold]", f"{100 * self._part[step]:.0f} %")
                grid.add_row("", bar, "")
            else:
                grid.add_row("·", f"[dim]{says}[/dim]", "")
        return grid


def result_lines(outcome: Outcome) -> list[tuple[str, str, str, str, str]]:
    """Rows of the before/after table: name, peak um, std um, peak deg, std deg."""
    rows = []
    for view in ("truth", "measured"):
        for when, found in (("before", outcome.before), ("after", outcome.after)):
            seen: Summary | None = found.truth if view == "truth" else found.measured
            if seen is not None:
                name = "noise-free truth" if view == "truth" else "as the tracker sees it"
                rows.append(
                    (
                        f"{name}, {when}",
                        f"{seen.position_peak_um:.1f}",
                        f"{seen.position_std_um:.1f}",
                        f"{seen.orientation_peak_deg:.4f}",
                        f"{seen.orientation_std_deg:.4f}",
                    )
                )
    after = outcome.after
    rows.append(
        ("tracker noise alone", f"{after.noise_peak_um:.1f}", "", f"{after.noise_peak_deg:.4f}", "")
    )
    peaks = (f"{PAPER['position_peak_um']:.1f}", "", f"{PAPER['orientation_peak_deg']:.4f}", "")
    rows.append(("Han et al. 2020, measured after", *peaks))
    return rows
