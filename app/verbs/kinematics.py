"""Turn actuators into poses or poses into actuators, by the geometry of a machine

The machine file's geometry, or that of a saved model.
"""

from pathlib import Path

import click

from app import answer
from calib.errors import BadInput


@click.command()
@click.argument("machine", metavar="MACHINE")
@click.option(
    "--forward",
    "actuators",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="CSV with a column for each actuator: where does the platform go?",
)
@click.option(
    "--inverse",
    "poses",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="CSV of poses: what must the actuators be?",
)
@click.option(
    "--model", type=click.Path(path_type=Path, dir_okay=False), help="Geometry of a saved model."
)
@click.option("--degrees", is_flag=True, help="Angles of the answer in degrees, not in rad.")
@click.option("--out", type=answer.WrittenFile(), help="Write the table to FILE (CSV).")
@answer.json_option
def command(
    machine: str,
    actuators: Path | None,
    poses: Path | None,
    model: Path | None,
    degrees: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Compute poses from actuator coordinates, or actuator coordinates from poses.

    Units stand in the heads of columns, as rx [deg] or q1_deg, or behind a number, as 12 deg; what
    has none is in mm or rad. Poses are x, y, z, rx, ry, rz with R = Rz(rz) Ry(ry) Rx(rx), or the
    coordinates that the machine commands. What corrects all effects too is pkmcal correct.
    """
    from app.jobs.kinematics import kinematics

    if (actuators is None) == (poses is None):
        raise BadInput("one of --forward and --inverse is needed", remedy="Name one file")
    if actuators is not None:
        found = kinematics(machine, actuators, "forward", model=model)
    else:
        assert poses is not None
        found = kinematics(machine, poses, "inverse", model=model)
    table = found.table(degrees=degrees)
    if out is not None:
        out.write_text(table, encoding="utf-8", newline="\n")
        answer.say(f"written to {out}")
    if out is None or as_json:
        answer.show(found.to_json(), as_json, table.rstrip("\n"))
    failed = sum(not one.closes for one in found.places)
    if failed:
        answer.say(f"{failed} of {len(found.places)} do not close")
