"""Write one HTML page: error before and after, parameters, drift"""

import json
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis import load_rows, model_options
from app.machine_files import read_text
from app.report.calibration import Checked, calibration_page
from app.session.plan import Plan
from app.verification import FORMAT
from calib.errors import BadInput
from calib.identify import fit, fit_report
from calib.model import Model


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@model_options
@click.option("--before", type=click.Path(path_type=Path), help="What verify --save kept before.")
@click.option("--after", type=click.Path(path_type=Path), help="What verify --save kept after.")
@click.option("--title", default="", help="Title of the page.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default="report.html",
    show_default=True,
    help="File to write.",
)
@answer.json_option
def command(
    runs: tuple[str, ...],
    add: tuple[str, ...],
    model: Path | None,
    before: Path | None,
    after: Path | None,
    title: str,
    out: Path,
    as_json: bool,
) -> None:
    """Fit RUN... once more and write what was found as one self-contained HTML page."""
    write_report(runs, add, model, before, after, title, out)
    answer.show({"format": "pkm-report/1", "file": str(out)}, as_json, f"report in {out}")


def write_report(
    runs: tuple[str, ...],
    add: tuple[str, ...],
    model: Path | None,
    before: Path | None,
    after: Path | None,
    title: str,
    out: Path,
) -> dict[str, Any]:
    """Write the page; answers the ``pkm-fit/1`` that stands in it."""
    rows, effects = load_rows(runs, add, model)
    found = fit(Model(rows, effects))
    said = fit_report(found)
    page = calibration_page(
        title or f"Calibration of {rows.machine.name}",
        found,
        said,
        read_checked(before) if before else None,
        read_checked(after) if after else None,
        f"pkmcal {version('pkmcal')}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC, "
        f"from {', '.join(runs)}",
    )
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(page.html(), encoding="utf-8")
    except OSError as error:
        raise BadInput(
            f"cannot write: {error}", place=str(out), remedy="Name another --out."
        ) from error
    return said


def read_checked(path: Path) -> Checked:
    """Read what ``verify --save`` kept, and the plan of its session."""
    try:
        found = json.loads(read_text(path))
        if found["format"] != FORMAT:
            raise ValueError(f"format {found['format']!r}")
        plan_file = Path(found["session"]) / "plan.json"
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a saved verification ({error})", place=str(path), remedy="pkmcal verify --save"
        ) from error
    return Checked(found, Plan.from_json(read_text(plan_file), str(plan_file)).poses)
