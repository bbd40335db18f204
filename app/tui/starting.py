"""The empty first screen: the whole job as a list, what lies in the folder, a run to try it on."""

from pathlib import Path

from textual.content import Content

from app.session.facts import SessionFacts
from app.show.clocks import clock
from app.tui.next_step import JobStep

MYSTERY = Path(__file__).parents[2] / "tests" / "data" / "runs" / "mystery"
"""The run of the first tutorial, where the program lies in a clone."""


def session_words(facts: SessionFacts) -> str:
    """One session in a list: when, what, of which machine, how far, title."""
    state = "" if facts.state == "finished" else f", {facts.done} of {facts.steps} steps"
    machine = f"{facts.machine} {facts.serial}".strip()
    title = f" · {facts.title}" if facts.title else ""
    return f"{clock(facts.begun_utc)}  {facts.purpose}, {machine}{state}{title}"


def start_text(steps: list[JobStep], recent: list[SessionFacts]) -> Content:
    """What is to be done, in its order, with keys; then the last sessions."""
    lines = [
        Content.from_markup(
            "No site is open.  [bold $ink-accent]o[/] opens a site file,  "
            "[bold $ink-accent]m[/] starts a mock machine."
        )
    ]
    if MYSTERY.is_dir():
        lines.append(
            Content.from_markup(
                "[bold $ink-accent]t[/] tries the mystery run: what is wrong with this hexapod?"
            )
        )
    lines.append(Content(""))
    lines += [
        Content.from_markup(
            "[dim]$number[/] [bold]$keys[/]  $says",
            number=f"{number}.",
            keys=f"{step.keys:<8}",
            says=step.says,
        )
        for number, step in enumerate(steps, start=1)
    ]
    if recent:
        lines.append(Content(""))
        lines.append(
            Content.from_markup(
                "[dim]last sessions;[/]  [bold $ink-accent]a[/] watches one that another terminal "
                "runs,  [bold $ink-accent]h[/] looks back"
            )
        )
        lines += [Content(session_words(facts)) for facts in recent]
    return Content("\n").join(lines)
