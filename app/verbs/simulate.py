"""Simulate a measuring run of a machine, with noise and, if wanted, something wrong with it"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from app import answer
from calib.errors import BadInput

FOLDER = click.Path(path_type=Path, file_okay=False)
FILE = click.Path(path_type=Path, dir_okay=False)


@click.command()
@click.argument("machine")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    metavar="RUN",
    help="Folder of the run.",
)
@click.option("--seed", default=1, show_default=True, help="Draws truth, room, noise and poses.")
@click.option("--poses", default="60", show_default=True, metavar="N|FILE", help="How many, which.")
@click.option("--noise-um", type=float, help="Per axis; without: as a tracker's own.")
@click.option("--hidden", type=FILE, help="File of hidden effects, table [hidden].")
@click.option("--effect", multiple=True, metavar="NAME=VALUE", help="A hidden effect; repeatable.")
@click.option("--truth", type=FILE, help="Where the truth goes.  [default: RUN/truth.json]")
@click.option("--parameters", type=FILE, help="File of true parameters; without: drawn.")
@click.option("--controller", type=FILE, help="File of the parameters that the controller uses.")
@click.option("--cycles", default=1, show_default=True, help="Visits of all poses (ISO 9283).")
@click.option(
    "--order",
    type=click.Choice(["nest-by-nest", "pose-by-pose"]),
    default="nest-by-nest",
    show_default=True,
    help="One SMR that is carried, or one in every nest.",
)
@click.option("--payload", type=float, multiple=True, help="kg; repeated: put on in turn.")
@click.option("--rise", default=6.0, show_default=True, help="Warming of the structure, K.")
@click.option("--delays", is_flag=True, help="Write a column delay_s.")
@click.option("--strays", default=0, show_default=True, help="So many wrong readings.")
@click.option("--title", default="", help="Of the run.")
@answer.json_option
def command(machine: str, out: Path, truth: Path | None, as_json: bool, **options: Any) -> None:
    """Write a simulated run of MACHINE, and apart from it the truth.

    For the hexapod, the tripod and the ptm the physics is that of the mock machines and shares
    nothing with the model that is fitted; so it is for arms, your own too, once something is to
    be hidden. Any other machine is a virtual prototype: errors within its tolerances, solved by
    the engine, without hidden effects.
    The same seed gives the same run; changing the noise changes nothing else. FILE with poses is
    a poses file or a CSV table.
    """
    from app.jobs.simulating import simulate

    poses = options.pop("poses")
    effects = _values(options.pop("effect"))
    asked = {**options, "poses": int(poses) if poses.isdigit() else poses, "effects": effects}
    report = simulate(machine, out, truth=truth, **asked).to_json()
    answer.show(report, as_json, _words(report))


def _values(texts: Sequence[str]) -> dict[str, float]:
    """NAME=VALUE by name; raises BadInput."""
    values = {}
    for text in texts:
        name, sign, value = text.partition("=")
        try:
            if not sign:
                raise ValueError(f'"{text}" is no NAME=VALUE')
            values[name.strip()] = float(value)
        except ValueError as wrong:
            raise BadInput(str(wrong), remedy="Correct the options") from wrong
    return values


def _words(report: dict[str, Any]) -> str:
    return (
        f"{report['run']}: {report['readings']} readings at {report['poses']} poses of "
        f"{report['machine']}; the truth is in {report['truth']}"
    )
