"""Measure the error that is left, over a grid of poses"""

import asyncio
from pathlib import Path
from typing import Any

import click

from app import answer
from app.console import run_on_console, unattended
from app.files.site import load_site
from app.jobs.verifying import begin_verifying, read_before, verification_report
from app.report.sources import run_before
from app.verification import REFERENCE_EVERY


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
@click.option(
    "--save", "save_file", type=click.Path(path_type=Path), help="Keep the answer in a file."
)
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
    show. Nothing is fitted and nothing is written to the controller.
    """
    site = load_site(site_file)
    before = read_before(before_file) if before_file else None
    session = begin_verifying(
        site,
        poses_file,
        folder=folder,
        truth=truth,
        reference_every=reference_every,
        unattended=unattended(alone),
    )
    answer.say(f"session {session.folder}")
    asyncio.run(run_on_console(session, quiet=as_json))
    report = verification_report(session.folder, before)
    if save_file:
        report.save(save_file)
    found = report.to_json()
    answer.show(found, as_json, words(found))
    if not as_json and (run := run_before(session.folder)) is not None:
        answer.say(f"the calibration record: pkmcal report {run}")


def words(found: dict[str, Any]) -> str:
    """The table of a verification, with the earlier one and the paper's beside it."""
    rows: list[tuple[str, ...]] = []
    views = [("measured", "measured"), *([("truth", "true")] if found["truth"] else [])]
    for when, data in (("before", found["before"]), ("now", found)):
        rows += [
            (
                f"{name}, {when}",
                f"{data[key]['position_peak_um']:.1f}",
                f"{data[key]['position_std_um']:.1f}",
                f"{data[key]['orientation_peak_deg']:.4f}",
                f"{data[key]['orientation_std_deg']:.4f}",
            )
            for key, name in views
            if data and data.get(key)
        ]
    noise, paper = found["noise_alone"], found["paper"]
    for name, data in (("tracker noise alone", noise), ("Han et al. 2020, after", paper)):
        rows.append(
            (name, f"{data['position_peak_um']:.1f}", "", f"{data['orientation_peak_deg']:.4f}", "")
        )
    head = ("", "peak um", "std um", "peak deg", "std deg")
    return f"{found['poses']} poses\n" + answer.table(head, rows)
