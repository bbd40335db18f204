"""See which geometric errors matter, and what tolerances an accuracy asks for"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from app import answer
from app.analysis_options import bars, chosen_machine, machine_options
from calib.errors import BadInput

if TYPE_CHECKING:
    from calib.analysis.sensitivity import Index, Sensitivity, Tolerance

DEGREE = math.radians(1.0)


@click.command()
@machine_options
@click.option("--each", is_flag=True, help="Every parameter by itself instead of its kind.")
@click.option("--position-um", type=float, help="Wanted standard deviation of the position, um.")
@click.option("--orientation-mdeg", type=float, help="The same of the orientation, mdeg.")
@click.option(
    "--poses",
    type=click.IntRange(1),
    default=500,
    show_default=True,
    help="Poses over the workspace.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of these poses."
)
@click.option("--figure", type=click.Path(path_type=Path), help="Write bar charts (png, svg, pdf).")
@answer.json_option
def command(
    machine_name: str,
    closure: str,
    each: bool,
    position_um: float | None,
    orientation_mdeg: float | None,
    poses: int,
    seed: int,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Global sensitivity of the pose to every geometric error, mean and spread over the workspace.

    Errors of a kind are taken together over all limbs. With a wanted accuracy the tolerances are
    told: +-3 sigma, for each kind alone and for all kinds sharing it equally.

    Sensitivity is not identifiability: what matters most need not be what a calibration can tell
    apart. See pkmcal identifiability.
    """
    import numpy as np

    from calib.analysis.coverage import workspace_poses
    from calib.analysis.sensitivity import sensitivity, tolerances

    for value, option in ((position_um, "--position-um"), (orientation_mdeg, "--orientation-mdeg")):
        if value is not None and value <= 0.0:
            raise BadInput(f"{option} is {value:g}", remedy="Give a positive accuracy.")
    machine = chosen_machine(machine_name, closure)
    found = sensitivity(workspace_poses(machine, poses, np.random.default_rng(seed)))
    wanted: tuple[Tolerance, ...] = ()
    if position_um is not None or orientation_mdeg is not None:
        wanted = tolerances(
            found,
            position=None if position_um is None else position_um * 1e-3,
            orientation=None if orientation_mdeg is None else orientation_mdeg * 1e-3 * DEGREE,
        )
    if figure:
        from app.show.charts import sensitivity_chart

        sensitivity_chart(found.parameters if each else found.kinds, machine.name, figure)
        answer.say(f"written to {figure}")
    data = {
        "format": "pkm-sensitivity/1",
        "machine": machine.name,
        "closure": closure or "own",
        "poses": found.poses,
        "parameters": [_data(i) for i in found.parameters],
        "kinds": [_data(i) for i in found.kinds],
        "within_tolerances": {
            "position_rms_mm": found.position_sigma,
            "orientation_rms_deg": found.orientation_sigma / DEGREE,
        },
        "tolerances": [_tolerance(t) for t in wanted],
    }
    answer.show(data, as_json, _text(found, machine.name, wanted, each))


def _per(unit: str) -> tuple[str, float]:
    """Unit in which an error is told, and how much of the machine file's unit it is."""
    return ("deg", DEGREE) if unit == "rad" else (unit, 1.0)


def _data(index: "Index") -> dict[str, Any]:
    unit, factor = _per(index.unit)
    return {
        "name": index.name,
        "per": unit,
        "position_mm": index.position * factor,
        "position_spread_mm": index.position_spread * factor,
        "orientation_deg": index.orientation * factor / DEGREE,
        "orientation_spread_deg": index.orientation_spread * factor / DEGREE,
        "tolerance": index.tolerance / factor,
        "position_share_mm": index.position_share,
        "orientation_share_deg": index.orientation_share / DEGREE,
    }


def _tolerance(tolerance: "Tolerance") -> dict[str, Any]:
    unit, factor = _per(tolerance.unit)
    return {
        "kind": tolerance.kind,
        "unit": unit,
        "alone": tolerance.alone / factor,
        "shared": tolerance.shared / factor,
    }


def _text(found: "Sensitivity", machine: str, wanted: "tuple[Tolerance, ...]", each: bool) -> str:
    indices = found.parameters if each else found.kinds
    drawn = bars([i.position_share + 1e-300 for i in indices])
    rows = []
    for index, bar in zip(indices, drawn, strict=True):
        unit, factor = _per(index.unit)
        rows.append(
            [
                index.name,
                f"/{unit}",
                f"{index.position * factor:.4f}",
                f"{index.position_spread * factor:.4f}",
                f"{index.orientation * factor / DEGREE:.4f}",
                f"{index.orientation_spread * factor / DEGREE:.4f}",
                f"{index.tolerance / factor:.3g}",
                f"{index.position_share * 1e3:.1f}",
                bar.ljust(24),
            ]
        )
    header = ["error", "per", "mm", "+-", "deg", "+-", "tolerance", "um", "".ljust(24)]
    text = (
        f"{machine}: mean and spread over {found.poses} poses of the pose error per unit of each "
        f"{'error' if each else 'kind of error (all limbs)'};\num: what its tolerance causes, "
        f"1 sigma\n\n{answer.table(header, rows)}\n\nA machine within its tolerances: position "
        f"{found.position_sigma:.3f} mm, orientation {found.orientation_sigma / DEGREE:.3f} deg RMS"
    )
    if wanted:
        rows = [
            [t["kind"], t["unit"], f"{t['alone']:.4g}", f"{t['shared']:.4g}"]
            for t in map(_tolerance, wanted)
        ]
        header = ["kind", "unit", "+- if alone", "+- if shared"]
        text += f"\n\nTolerances for the wanted accuracy:\n\n{answer.table(header, rows)}"
    return text
