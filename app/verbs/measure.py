"""Measure poses with a tracker or a gauge, and write a run"""

import asyncio
from pathlib import Path
from typing import cast

import click

from app import answer


@click.command()
@click.option(
    "--site",
    "site_file",
    required=True,
    type=click.Path(path_type=Path),
    help="Site file: addresses, nests, who carries SMRs.",
)
@click.option(
    "--poses",
    "poses_file",
    required=True,
    type=click.Path(path_type=Path),
    help="Poses to visit; pkmcal poses chooses good ones.",
)
@click.option(
    "--order",
    type=click.Choice(["nest-by-nest", "pose-by-pose"]),
    default=None,
    help="One SMR carried from nest to nest, or SMRs in all nests.  [default: by SMRs at hand]",
)
@click.option(
    "--reference-every",
    default=10,
    show_default=True,
    type=click.IntRange(1),
    help="Poses between two looks at the base nests.",
)
@click.option(
    "--cycles",
    default=1,
    show_default=True,
    type=click.IntRange(1),
    help="How many times all poses are visited.",
)
@click.option(
    "--pair", "pairs", multiple=True, metavar="A:B",
    help="With a gauge that reads distances: marks at two poses; repeated.",
)  # fmt: skip
@click.option("--no-warm-up", is_flag=True, help="Do not wait until temperatures are steady.")
@click.option("--unattended", "alone", is_flag=True, help="Nobody answers questions.")
@click.option(
    "--folder",
    default="sessions",
    type=click.Path(path_type=Path),
    help="Where the session's folder is made.",
)
@click.option("--title", default="", help="Title of the run.")
@answer.json_option
def command(
    site_file: Path,
    poses_file: Path,
    order: str | None,
    reference_every: int,
    cycles: int,
    pairs: tuple[str, ...],
    no_warm_up: bool,
    alone: bool,
    folder: Path,
    title: str,
    as_json: bool,
) -> None:
    """Visit all poses with an SMR in each nest and write the readings as a run.

    Where the site has a gauge instead of a tracker its number is read at each pose: a plate is
    touched at these places, or a bar is read between nests (docs/gauges.md).

    Everything is journaled as it happens: after a stop, a fault or a power cut, pkmcal resume
    goes on where the session was. The whole path is checked against all limits before the first
    move.
    """
    from app.console import run_on_console, unattended
    from app.files.site import load_site
    from app.jobs.measuring import begin_measuring, mark_pair, session_report
    from app.session.plans import Order

    session = begin_measuring(
        load_site(site_file),
        poses_file,
        folder=folder,
        order=cast(Order, order) if order else None,
        reference_every=reference_every,
        cycles=cycles,
        warm_up=not no_warm_up,
        title=title,
        pairs=[mark_pair(one) for one in pairs],
        unattended=unattended(alone),
    )
    answer.say(f"session {session.folder}")
    report = session_report(asyncio.run(run_on_console(session, quiet=as_json)))
    answer.show(report.to_json(), as_json, f"{report.readings} readings in {report.run}")
    if not as_json:
        answer.say(f"when all is done, the calibration record: pkmcal report {report.run}")
