"""Go on with a session that was stopped, failed or was killed"""

import asyncio
from pathlib import Path

import click

from app import answer
from app.console import run_on_console, unattended
from app.session import Session
from app.session.folder import latest_session
from app.verbs.measure import outcome_json


@click.command()
@click.argument("session_folder", required=False, type=click.Path(path_type=Path))
@click.option(
    "--folder",
    default="sessions",
    type=click.Path(path_type=Path),
    help="Where sessions are; the latest is taken if none is named.",
)
@click.option("--unattended", "alone", is_flag=True, help="Nobody answers questions.")
@answer.json_option
def command(session_folder: Path | None, folder: Path, alone: bool, as_json: bool) -> None:
    """Go on where a session was: nothing is lost, nothing is counted twice.

    A step that had begun and has no result is in doubt: the controller is asked where the machine
    was sent, the last reference is read again, and the step is done anew.
    """
    chosen = session_folder or latest_session(folder)
    session = Session.reopen(chosen, unattended=unattended(alone))
    answer.say(f"session {session.folder}")
    outcome = asyncio.run(run_on_console(session, quiet=as_json))
    answer.show(
        outcome_json(outcome), as_json, f"{outcome.readings} readings in {outcome.run_folder}"
    )
