"""What comes next: the steps of a calibration, which are done, and the key of the next one."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from textual.content import Content
from textual.widgets import Static

if TYPE_CHECKING:
    from app.tui.desk import Desk


@dataclass(frozen=True)
class JobStep:
    """One step: its word, what it does, the keys that begin it; ``live``: it needs the devices."""

    word: str
    says: str
    keys: str
    done: bool
    live: bool = False


def job_steps(desk: "Desk") -> list[JobStep]:
    """The steps in their order, as far as this program has come with them."""
    study, done = desk.study, desk.course.done
    view = study.search.view if study.search is not None else None
    fitted = study.answer is not None or view is not None
    adequate = view is not None and bool(view.diagnosis["adequate"])
    asking = "4 d" if view is None else "4 g"
    return [
        JobStep(
            "connect",
            "open a site and connect (c), or start a mock, which connects by itself",
            "1 c" if desk.site is not None else "1 o or m",
            desk.connected,
        ),
        JobStep("found", "verify before anything is changed", "6 v", "found" in done, True),
        JobStep("measure", "measure poses", "2 n", bool(study.runs), True),
        JobStep("fit", "fit the run", "3 f", fitted),
        JobStep("discover", "ask what the model misses, and add it", asking, adequate),
        JobStep(
            "apply", "compare with the controller, and write", "5 c a", "applied" in done, True
        ),
        JobStep("left", "verify again", "6 v", "left" in done, True),
        JobStep("record", "write the calibration record", "6 p", "record" in done),
    ]


def next_of(steps: list[JobStep]) -> JobStep | None:
    """The first step after the last that is done, or to connect if that needs the devices.

    None when all is done.
    """
    connect = steps[0]
    last = max((number for number, step in enumerate(steps) if step.done), default=-1)
    coming = next((step for step in steps[last + 1 :] if not step.done), None)
    return connect if coming is not None and coming.live and not connect.done else coming


class NextLine(Static):
    """One line on every screen: what comes next, with its keys, and ticks at what is done."""

    def show(self, desk: "Desk") -> None:
        """Draw the steps; while a job runs that is said in place of the next one."""
        steps = job_steps(desk)
        coming = None if desk.busy else next_of(steps)
        if desk.busy:
            said = "a job runs: 2 "
        else:
            said = "all is done" if coming is None else f"next {coming.keys}"
        parts: list[Content | tuple[str, str] | str] = [(said, "bold"), " "]
        for step in steps:
            sign, style = ("✓", "") if step.done else ("·", "dim")
            if step is coming:
                sign, style = "▶", "bold"
            parts += [" ", (f"{sign}{step.word}", style)]
        self.update(Content.assemble(*parts))
