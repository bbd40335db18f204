"""Read what happened in a session, by the clock"""

from pathlib import Path

import click

from app import answer
from app.show.clocks import happening_line

QUIET = ("started",)
"""Kinds of entries that only --all shows: their ends tell as much."""


@click.command()
@click.argument("session", required=False, type=click.Path(path_type=Path))
@click.option(
    "--folder",
    default="sessions",
    type=click.Path(path_type=Path),
    help="Where sessions are; the newest is read if none is named.",
)
@click.option("--all", "everything", is_flag=True, help="Also where each step began.")
@answer.json_option
def command(session: Path | None, folder: Path, everything: bool, as_json: bool) -> None:
    """Read the journal of SESSION: steps, alarms, questions and answers, with clock times."""
    from app.jobs.listing import session_log

    found = session_log(session, folder=folder)
    head = found.session
    lines = [
        f"{head.folder}: {head.purpose}, {head.machine} {head.serial}, {head.title}".rstrip(", "),
        f"{head.state}, {head.done} of {head.steps} steps, {head.readings} readings",
    ]
    lines += [
        happening_line(one.utc, one.kind, one.text)
        for one in found.entries
        if everything or one.kind not in QUIET
    ]
    answer.show(found.to_json(), as_json, "\n".join(lines))
