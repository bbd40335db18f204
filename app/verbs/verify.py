"""Measure the error that is left, over a grid of poses"""

import asyncio
import json
from pathlib import Path
from typing import Any

import click

from app import answer
from app.console import run_on_console, unattended
from app.files.poses import read_any_poses
from app.files.site import load_site
from app.files.text import read_text
from app.session import Session
from app.verification import FORMAT, REFERENCE_EVERY, judge_session, verification_plan
from calib.errors import BadInput
from calib.poses import verification_poses


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
    before = _read_before(before_file) if before_file else None
    poses = (
        read_any_poses(poses_file, site.machine)
        if poses_file
        else verification_poses(site.machine).by_label
    )
    plan = verification_plan(site, poses, truth=truth, reference_every=reference_every)
    session = Session.create(site, plan, folder, unattended=unattended(alone))
    answer.say(f"session {session.folder}")
    asyncio.run(run_on_console(session, quiet=as_json))
    found = judge_session(session.folder).to_json()
    found["session"] = str(session.folder)
    found["before"] = before and {k: before[k] for k in ("measured", "truth", "noise_alone")}
    if save_file:
        save_file.write_text(json.dumps(found, indent=1), encoding="utf-8")
    answer.show(found, as_json, words(found))


def _read_before(path: Path) -> dict[str, Any]:
    try:
        data: dict[str, Any] = json.loads(read_text(path))
        if data["format"] != FORMAT or "measured" not in data:
            raise ValueError("another format")
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a saved verification ({error})", place=str(path), remedy="pkmcal verify --save"
        ) from error
    return data


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
