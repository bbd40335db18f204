"""What comes next: the steps of a calibration, which are done, and the key of the next one."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from textual.content import Content
from textual.widgets import Static

if TYPE_CHECKING:
    from app.tui.desk import Desk


BY_TRACKER = ("found", "apply", "left", "record")
"""Steps that a site with a gauge has not: what is verified and written is measured by a tracker."""


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
    broken = desk.picture.run in ("stopped", "fault") and desk.session is not None
    ended = desk.picture.purpose if broken else ""  # g on Measure goes on with it
    verifying = "2 g" if ended == "verify" else "6 v"
    measuring = "2 g" if ended == "measure" else "2 n"
    steps = [
        JobStep(
            "connect",
            "open a site and connect (c), or start a mock",
            "1 c" if desk.site is not None else "1 o or m",
            desk.connected,
        ),
        JobStep("found", "verify before anything is changed", verifying, "found" in done, True),
        JobStep("measure", "measure poses", measuring, bool(study.runs), True),
        JobStep("fit", "fit the run", "3 f", fitted),
        JobStep("discover", "ask what the model misses, and add it", asking, adequate),
        JobStep(
            "apply", "compare with the controller, and write", "5 c a", "applied" in done, True
        ),
        JobStep("left", "verify again", verifying, "left" in done, True),
        JobStep("record", "write the calibration record", "6 p", "record" in done),
    ]
    by_gauge = desk.site is not None and desk.site.gauge is not None
    return [step for step in steps if not (by_gauge and step.word in BY_TRACKER)]


def next_of(steps: list[JobStep]) -> JobStep | None:
    """The first step after the last that is done, or to connect if that needs the devices.

    None when all is done.
    """
    connect = steps[0]
    last = max((number for number, step in enumerate(steps) if step.done), default=-1)
    coming = next((step for step in steps[last + 1 :] if not step.done), None)
    return connect if coming is not None and coming.live and not connect.done else coming


def in_work(desk: "Desk") -> str:
    """The word of the step that the running job is; empty where none runs, or it is none."""
    if not desk.busy or desk.automatic.running is not None:
        return ""
    if desk.corrections.running is not None:
        return "apply"
    purpose = desk.picture.purpose if desk.session is not None else ""
    verified = "left" if "applied" in desk.course.done else "found"
    return {"measure": "measure", "verify": verified}.get(purpose, "")


class NextLine(Static):
    """One line on every screen: what comes next, with its keys, and ticks at what is done."""

    def show(self, desk: "Desk") -> None:
        """Draw the steps; while a job runs that is said in place of the next one."""
        steps = job_steps(desk)
        working = in_work(desk)
        coming = None if desk.busy else next_of(steps)
        if desk.busy:
            said = "a job runs: 2 "
        else:
            said = "all is done" if coming is None else f"next {coming.keys}"
        parts: list[Content | tuple[str, str] | str] = [(said, "bold"), " "]
        for step in steps:
            sign, style = ("✓", "") if step.done else ("·", "dim")
            if step is coming or step.word == working:
                sign, style = "▶", "bold"
            parts += [" ", (f"{sign}{step.word}", style)]
        self.update(Content.assemble(*parts))
