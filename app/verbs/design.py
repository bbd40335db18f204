"""Plan the next measurements: those that tell two effects apart

The poses file that it writes is measured with pkmcal measure; then fit old and new run together.
"""

import math
from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis_options import model_options, offer_options, offers
from app.show.text_table import text_table
from calib.defaults import FOLLOW_UP_FROM


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@click.option(
    "--discriminate",
    nargs=2,
    required=True,
    metavar="A B",
    help="Two effects; B may be 'nothing': is A there at all?",
)
@click.option("--n", "count", default=10, show_default=True, type=click.IntRange(1, 60))
@click.option(
    "--candidates", default=FOLLOW_UP_FROM, show_default=True, type=click.IntRange(20, 5000)
)
@click.option("--seed", default=1, show_default=True, help="Seed of the reachable candidates.")
@click.option("--out", type=answer.WrittenFile(), help="Write a poses file for measure.")
@model_options
@offer_options
@answer.json_option
def command(
    runs: tuple[str, ...],
    discriminate: tuple[str, str],
    count: int,
    candidates: int,
    seed: int,
    out: Path | None,
    add: tuple[str, ...],
    model: Path | None,
    offer: tuple[Path, ...],
    site: Path | None,
    as_json: bool,
) -> None:
    """Choose the poses, their order, load and temperature that tell effect A from effect B.

    RUN... are the runs there are; the sizes of A and B are those that they show, or the usual
    ones where they show nothing. The answer says how likely the right one is recognised now, and
    with the follow-up too.
    """
    from app.files.runs import outside_runs
    from app.jobs.following_up import design

    outside_runs(out, runs)
    plan = design(
        runs,
        discriminate,
        count,
        add=add,
        model=model,
        offer=offers(offer, site),
        candidates=candidates,
        seed=seed,
        watch=lambda condition: answer.say(f"choosing {count} poses, {condition} ..."),
    )
    if out is not None:
        plan.save(out)
        answer.say(f"written to {out}")
    report = plan.to_json()
    answer.show(report, as_json, words(report))


def words(report: dict[str, Any]) -> str:
    """Say a plan to a person."""
    first, second = report["discriminate"]
    rows = [
        (name, f"{report['right_now'][name]:.0%}", f"{report['right_then'][name]:.0%}")
        for name in report["right_now"]
    ]
    coordinates = [key for key in report["poses"][0] if key not in ("label", "q")]
    poses = [
        (pose["label"], *(_coordinate(name, float(pose[name])) for name in coordinates))
        for pose in report["poses"]
    ]
    header = ("pose", *(name if name in "xyz" else f"{name} deg" for name in coordinates))
    return "\n".join(
        [
            f"telling {first} from {second}: probability of the right answer",
            text_table(("if the truth is", "now", "with the follow-up"), rows),
            "",
            *(f"{name} must be {value:g}" for name, value in report["conditions"].items()),
            "in this order (the direction of approach is that of the way there):",
            text_table(header, poses),
            "",
            report["advice"],
        ]
    )


def _coordinate(name: str, value: float) -> str:
    return f"{value:.2f}" if name in "xyz" else f"{math.degrees(value):.3f}"
