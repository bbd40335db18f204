"""See which geometric errors matter, and what tolerances an accuracy asks for"""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from app import answer
from app.analysis_options import (
    bars,
    machine_options,
    monte_carlo_option,
    progress,
    spread_options,
)
from app.show.drawn_words import drawn_words
from app.show.text_table import text_table

if TYPE_CHECKING:
    from app.jobs.sensing import SensitivityReport


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
@monte_carlo_option
@spread_options
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
    monte_carlo: int,
    workers: int | None,
    scheduler: str,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Global sensitivity of the pose to every geometric error, mean and spread over the workspace.

    Errors of a kind are taken together over all limbs. With a wanted accuracy the tolerances are
    told: +-3 sigma, for each kind alone and for all kinds sharing it equally. All this is to first
    order; with --monte-carlo machines are drawn, and each is closed exactly at every pose.

    Sensitivity is not identifiability: what matters most need not be what a calibration can tell
    apart. See pkmcal identifiability.
    """
    from app.jobs.sensing import sensitivity

    with progress() as watch:
        found = sensitivity(
            machine_name,
            closure=closure,
            position_um=position_um,
            orientation_mdeg=orientation_mdeg,
            poses=poses,
            seed=seed,
            monte_carlo=monte_carlo,
            workers=workers,
            scheduler=scheduler,
            watch=watch,
        )
    if figure:
        found.draw(figure, each=each)
        answer.say(f"written to {figure}")
    answer.show(found.to_json(), as_json, _text(found, each))


def _text(found: "SensitivityReport", each: bool) -> str:
    indices = found.parameters if each else found.kinds
    drawn = bars([one.position_share_mm + 1e-300 for one in indices])
    rows = [
        [
            one.name,
            f"/{one.per}",
            f"{one.position_mm:.4f}",
            f"{one.position_spread_mm:.4f}",
            f"{one.orientation_deg:.4f}",
            f"{one.orientation_spread_deg:.4f}",
            f"{one.tolerance:.3g}",
            f"{one.position_share_mm * 1e3:.1f}",
            bar.ljust(24),
        ]
        for one, bar in zip(indices, drawn, strict=True)
    ]
    header = ["error", "per", "mm", "+-", "deg", "+-", "tolerance", "um", "".ljust(24)]
    within = found.within_tolerances
    text = (
        f"{found.machine}: mean and spread over {found.poses} poses of the pose error per unit of "
        f"each {'error' if each else 'kind of error (all limbs)'};\num: what its tolerance causes, "
        f"1 sigma\n\n{text_table(header, rows)}\n\nA machine within its tolerances: position "
        f"{within.position_rms_mm:.3f} mm, orientation {within.orientation_rms_deg:.3f} deg RMS"
    )
    if found.drawn is not None:
        drawn = found.to_json()["drawn"]
        text += f"\n\n{drawn_words(drawn, 'within their tolerances, not calibrated')}"
    if found.tolerances:
        rows = [
            [one.kind, one.unit, f"{one.alone:.4g}", f"{one.shared:.4g}"]
            for one in found.tolerances
        ]
        header = ["kind", "unit", "+- if alone", "+- if shared"]
        text += f"\n\nTolerances for the wanted accuracy:\n\n{text_table(header, rows)}"
    return text
