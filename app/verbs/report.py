"""Write one HTML page: error before and after, parameters, drift"""

from pathlib import Path

import click

from app import answer
from app.analysis_options import model_options
from app.files.runs import outside_runs
from app.report.build import write_report


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
    outside_runs(out, runs)
    write_report(runs, add=add, model=model, before=before, after=after, title=title, out=out)
    answer.show({"format": "pkm-report/1", "file": str(out)}, as_json, f"report in {out}")
