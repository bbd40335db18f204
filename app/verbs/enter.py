"""Type readings in by hand: heights, a dial gauge, calipers

For machines and instruments without a link. See docs/no-laser-tracker.md.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from app import answer
from app.defaults import UNITS
from calib.errors import BadInput

if TYPE_CHECKING:
    from app.jobs.entering import What


@click.command()
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@click.option(
    "--poses", required=True, metavar="FILE", type=click.Path(path_type=Path, dir_okay=False),
    help="Poses file or table: where the machine is sent.",
)  # fmt: skip
@click.option(
    "--what", type=click.Choice(["height", "gauge", "calipers"]), default="height",
    show_default=True, help="What is read.",
)  # fmt: skip
@click.option("--machine", metavar="NAME|FILE", help="Of a run that is begun.")
@click.option("--sigma-um", type=float, required=True, help="Standard uncertainty of a number.")
@click.option("--unit", type=click.Choice(list(UNITS)), default="mm", show_default=True)
@click.option("--comma", is_flag=True, help="Decimals stand behind a comma.")
@click.option(
    "--pair",
    "pairs",
    multiple=True,
    metavar="A:B",
    help="Marks for calipers; repeated.  [default: those of the poses file]",
)
@click.option(
    "--tool", nargs=3, type=float, default=(0.0, 0.0, 0.0), metavar="X Y Z", show_default=True,
    help="The tip in the platform frame, mm.",
)  # fmt: skip
@click.option(
    "--near", type=float, default=2.0, show_default=True, metavar="MM",
    help="How far machine and drawing may be apart before a number is doubted.",
)  # fmt: skip
@answer.json_option
def command(
    run: Path,
    poses: Path,
    what: "What",
    machine: str | None,
    sigma_um: float,
    unit: str,
    comma: bool,
    pairs: tuple[str, ...],
    tool: tuple[float, float, float],
    near: float,
    as_json: bool,
) -> None:
    """Type a number at each pose of FILE into RUN, a run of version 2.

    The machine is sent to each pose by whoever runs it; the actuator values that the nominal
    machine has there are shown and written. Each number is on the disk before the next is asked
    for: empty leaves a pose for later, b takes the last number back, s stops, and the same command
    goes on. A number that the machine contradicts is doubted at once: sign, exchanged digits,
    decimal point, inches, the number before once more. A gauge shows heights from a zero of its
    own; calipers measure between marks that the tool has left at poses (--pair A:B).
    """
    from app.jobs.entering import enter
    from app.jobs.measuring import mark_pair

    for name, value in (("--sigma-um", sigma_um), ("--near", near)):
        if not 0.0 < value < float("inf"):
            raise BadInput(
                f"{value:g} is not larger than zero", place=name, remedy="Give a positive number"
            )
    report = enter(
        run,
        poses,
        _ask,
        answer.say,
        what=what,
        sigma_mm=1e-3 * sigma_um,
        machine=machine,
        unit=unit,
        decimal="," if comma else ".",
        pairs=[mark_pair(one) for one in pairs],
        at=tool,
        near_mm=near,
    ).to_json()
    answer.show(report, as_json, _words(report))


def _ask(text: str) -> str:
    """Ask on standard error; the end of the input stops."""
    click.echo(f"{text}: ", nl=False, err=True)
    line = sys.stdin.readline()
    return line.rstrip("\n") if line else "s"


def _words(report: dict[str, Any]) -> str:
    left = report["left"]
    lines = [
        f"{report['run']}: {report['readings']} readings of {report['machine']}, {report['typed']} "
        "typed now"
    ]
    if left:
        few = ", ".join(left[:8]) + (" ..." if len(left) > 8 else "")
        lines.append(f"{len(left)} left ({few}): the same command goes on there")
    else:
        lines.append(f"Complete: pkmcal fit {report['run']}")
    return "\n".join(lines)
