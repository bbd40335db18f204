"""Go on with a session that was stopped, failed or was killed"""

import asyncio
from pathlib import Path

import click

from app import answer
from app.show.verification_words import verdict


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
    was sent, the last reference is read again, and the step is done anew. A verification ends with
    its verdict, beside the earlier one and in the file that it was asked for.
    """
    from app.console import run_on_console, unattended
    from app.jobs.measuring import begin_again, session_report
    from app.jobs.verifying import check_conclusion, concluded, is_verification

    session = begin_again(session_folder, folder=folder, unattended=unattended(alone))
    answer.say(f"session {session.folder}")
    if is_verification(session):
        check_conclusion(session.folder)
        asyncio.run(run_on_console(session, quiet=as_json))
        found = concluded(session.folder).to_json()
        answer.show(found, as_json, verdict(found))
        return
    report = session_report(asyncio.run(run_on_console(session, quiet=as_json)))
    answer.show(report.to_json(), as_json, f"{report.readings} readings in {report.run}")
