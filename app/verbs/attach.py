"""Watch a session that another terminal runs"""

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from app import answer
from app.plain_data import printable
from app.show.clocks import happening_line

if TYPE_CHECKING:
    from app.session.happenings import Following

POLL_S = 0.5
SILENT_S = 30.0
"""After so long without an entry it is said that nothing happens."""
LAST = 12
"""Entries of before that are shown first."""


@click.command()
@click.argument("session", required=False, type=click.Path(path_type=Path))
@click.option(
    "--folder",
    default="sessions",
    type=click.Path(path_type=Path),
    help="Where sessions are; the newest is watched if none is named.",
)
def command(session: Path | None, folder: Path) -> None:
    """Show SESSION as it goes on in another terminal, until it is finished; Ctrl-C leaves it.

    Only its journal is read: nothing that is done here reaches the machine, and the session goes
    on whether it is watched or not. To stop the machine use the terminal that runs it, or the
    emergency stop.
    """
    from app.session.folder import latest_session
    from app.session.happenings import Following

    followed = Following(session if session is not None else latest_session(folder))
    facts = followed.facts
    answer.say(f"{followed.folder}: {facts.purpose}, {facts.machine} {facts.serial}, {facts.title}")
    try:
        _watch(followed)
    except KeyboardInterrupt:
        answer.say("left; the session goes on")


def _watch(followed: "Following") -> None:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(highlight=False, soft_wrap=True)
    columns = (TextColumn("{task.completed:.0f} of {task.total:.0f}"), BarColumn(24),
               TextColumn("{task.description}", markup=False))  # fmt: skip
    news = followed.news()[-LAST:]
    quiet_since = time.monotonic()
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        # A bar that counts steps needs their number from the start: it draws itself at once.
        begun = followed.facts
        task = bar.add_task("", completed=begun.done, total=begun.steps)
        while True:
            for one in news:
                if one.kind != "started":
                    line = happening_line(one.utc, one.kind, one.text)
                    console.print(printable(line), markup=False)
            facts = followed.facts
            doing = next((one.text for one in reversed(news) if one.kind == "started"), None)
            bar.update(task, completed=facts.done, total=facts.steps)
            if news:
                quiet_since = time.monotonic()
                bar.update(task, description=doing or "")
            elif (quiet := time.monotonic() - quiet_since) > SILENT_S:
                bar.update(task, description=f"nothing for {quiet:.0f} s; is it still running?")
            if facts.state == "finished":
                answer.say(f"finished: {facts.readings} readings")
                return
            time.sleep(POLL_S)
            news = followed.news()
