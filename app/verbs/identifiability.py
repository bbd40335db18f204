"""See which parameters readings can tell apart, and what another reading would buy"""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from app import answer
from app.analysis_options import machine_options, monte_carlo_option, progress, spread_options

if TYPE_CHECKING:
    from app.jobs.telling_apart import Read


@click.command()
@machine_options
@click.option(
    "--read",
    type=click.Choice(["nests", "poses", "positions", "heights"]),
    default="nests",
    show_default=True,
    help="What is read at each pose: SMR nests, the whole pose, the platform's origin, or the "
    "nests' heights over the base.",
)
@click.option(
    "--nests",
    "nest_count",
    type=click.IntRange(1),
    default=3,
    show_default=True,
    help="Nests that are assumed.",
)
@click.option("--site", "site_file", type=click.Path(path_type=Path), help="Nests of a site file.")
@click.option("--sigma-um", type=float, help="Standard uncertainty of a reading per axis, um.")
@click.option("--frame-free/--frame-known", default=True, show_default=True, help="Base frame.")
@click.option("--nests-free/--nests-known", default=False, show_default=True, help="Nest centres.")
@click.option("--no-base-nests", is_flag=True, help="Nothing on the base is read.")
@click.option(
    "--poses",
    type=click.IntRange(1),
    help="Random reachable poses [60; a pointing machine: every 10 deg].",
)
@click.option("--poses-file", type=click.Path(path_type=Path), help="These poses instead.")
@click.option("--only", default="", help="A choice of parameters to judge: limb?.0dx1,limb5.*")
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the random poses."
)
@monte_carlo_option
@spread_options
@answer.json_option
def command(
    machine_name: str,
    closure: str,
    read: "Read",
    nest_count: int,
    site_file: Path | None,
    sigma_um: float | None,
    frame_free: bool,
    nests_free: bool,
    no_base_nests: bool,
    poses: int | None,
    poses_file: Path | None,
    only: str,
    seed: int,
    monte_carlo: int,
    workers: int | None,
    scheduler: str,
    as_json: bool,
) -> None:
    """Rank, groups that cannot be told apart, gauge freedoms, and what another reading would buy.

    Exactly invisible combinations and those that are only too weak for the tolerances are told
    apart. With --monte-carlo machines are drawn and calibrated from such readings, each closed
    exactly. Predicted errors show that a choice of the most sensitive parameters is not a choice of
    identifiable ones.
    """
    from app.jobs.telling_apart import identifiability

    with progress() as watch:
        found = identifiability(
            machine_name,
            closure=closure,
            read=read,
            nests=nest_count,
            site=site_file,
            sigma_um=sigma_um,
            frame_free=frame_free,
            nests_free=nests_free,
            base_nests=not no_base_nests,
            poses=poses_file or poses,
            only=only.split(",") if only else (),
            seed=seed,
            monte_carlo=monte_carlo,
            workers=workers,
            scheduler=scheduler,
            watch=watch,
        )
    answer.show(found.to_json(), as_json, found.text)
