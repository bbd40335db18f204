"""Measure the error that is left, over a grid of poses"""

import asyncio
from pathlib import Path

import click

from app import answer
from app.defaults import REFERENCE_EVERY
from app.show.verification_words import verdict


@click.command()
@click.option(
    "--site", "site_file", required=True, type=click.Path(path_type=Path), help="Site file."
)
@click.option(
    "--poses",
    "poses_file",
    type=click.Path(path_type=Path),
    help="Other poses than the grid of 27 nodes x 8 orientations.",
)
@click.option(
    "--reference-every",
    default=REFERENCE_EVERY,
    show_default=True,
    type=click.IntRange(1),
    help="Poses between two looks at the base nests.",
)
@click.option("--truth", is_flag=True, help="Also ask a mock for the noise-free truth.")
@click.option(
    "--before",
    "before_file",
    type=click.Path(path_type=Path),
    help="An earlier verification, to stand beside this one.",
)
@click.option("--save", "save_file", type=answer.WrittenFile(), help="Keep the answer in a file.")
@click.option("--unattended", "alone", is_flag=True, help="Nobody answers questions.")
@click.option(
    "--folder",
    default="sessions",
    type=click.Path(path_type=Path),
    help="Where the session's folder is made.",
)
@answer.json_option
def command(
    site_file: Path,
    poses_file: Path | None,
    reference_every: int,
    truth: bool,
    before_file: Path | None,
    save_file: Path | None,
    alone: bool,
    folder: Path,
    as_json: bool,
) -> None:
    """Send the machine over a grid, measure where it goes, and say how far off it is.

    Peak and standard deviation of the norm of the position error and of the rotation angle, in
    the base frame that the base nests give, beside the peak that the tracker's noise alone would
    show. Nothing is fitted and nothing is written to the controller. The answer is kept in the
    session's folder; one that was stopped ends with it after pkmcal resume.
    """
    from app.console import run_on_console, unattended
    from app.files.site import load_site
    from app.jobs.verifying import begin_verifying, concluded
    from app.report.sources import run_before

    site = load_site(site_file)
    session = begin_verifying(
        site,
        poses_file,
        folder=folder,
        truth=truth,
        reference_every=reference_every,
        before=before_file,
        save=save_file,
        unattended=unattended(alone),
    )
    answer.say(f"session {session.folder}")
    asyncio.run(run_on_console(session, quiet=as_json))
    found = concluded(session.folder).to_json()
    answer.show(found, as_json, verdict(found))
    if not as_json and (run := run_before(session.folder)) is not None:
        answer.say(f"the calibration record: pkmcal report {run}")
