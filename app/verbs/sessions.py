"""List the sessions of a folder: state, machine, title"""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from app import answer
from app.show.clocks import clock
from app.show.text_table import text_table

if TYPE_CHECKING:
    from app.jobs.listing import SessionEntry


@click.command()
@click.option(
    "--folder", default="sessions", type=click.Path(path_type=Path), help="Where sessions are."
)
@answer.json_option
def command(folder: Path, as_json: bool) -> None:
    """List the sessions of a folder, the newest first: what each was and how far it came."""
    from app.jobs.listing import list_sessions

    found = list_sessions(folder)
    heads = ("session", "begun", "what", "state", "machine", "poses", "readings", "title")
    width = max((len(one.title) for one in found.sessions), default=0)
    rows = [_row(one, width) for one in found.sessions]
    text = text_table((*heads[:-1], heads[-1].ljust(width)), rows)
    answer.show(found.to_json(), as_json, text if rows else f"no session in {folder}")


def _row(one: "SessionEntry", width: int) -> tuple[str, ...]:
    state = one.state if one.state != "begun" else f"{one.done} of {one.steps} steps"
    machine = f"{one.machine} {one.serial}".strip()
    return (
        one.folder, clock(one.begun_utc), one.purpose, state, machine, str(one.poses),
        str(one.readings), one.title.ljust(width),
    )  # fmt: skip
