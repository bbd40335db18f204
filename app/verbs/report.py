"""Write a calibration record: HTML and PDF"""

from pathlib import Path

import click

from app import answer
from app.analysis_options import mask_option, model_options

OUT = (Path("report.html"), Path("report.pdf"))


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@model_options
@mask_option
@click.option(
    "--before",
    type=click.Path(path_type=Path),
    help="As found: what verify --save kept, or a verification's folder.  [default: the last one "
    "before the run, among the sessions beside it]",
)
@click.option(
    "--after",
    type=click.Path(path_type=Path),
    help="As left, likewise.  [default: the last one after the run]",
)
@click.option(
    "--site",
    "site_file",
    type=click.Path(path_type=Path),
    help="Site file whose [record] names customer, laboratory, instruments, tolerance, templates.  "
    "[default: that of the run's session]",
)
@click.option(
    "--tolerance-um",
    type=click.FloatRange(0.0, min_open=True),
    help="Largest position error that is allowed.  [default: the site's]",
)
@click.option(
    "--tolerance-mdeg",
    type=click.FloatRange(0.0, min_open=True),
    help="Largest orientation error that is allowed.  [default: the site's]",
)
@click.option("--title", default="", help="Title of the record.  [default: Calibration record]")
@click.option(
    "--number", default="", help="Its number.  [default: begin of the run, serial number]"
)
@click.option(
    "--out",
    "outs",
    multiple=True,
    type=click.Path(path_type=Path),
    help="File to write, .html or .pdf (repeatable).  [default: report.html and report.pdf]",
)
@answer.json_option
def command(
    runs: tuple[str, ...],
    add: tuple[str, ...],
    model: Path | None,
    mask: tuple[str, ...],
    before: Path | None,
    after: Path | None,
    site_file: Path | None,
    tolerance_um: float | None,
    tolerance_mdeg: float | None,
    title: str,
    number: str,
    outs: tuple[Path, ...],
    as_json: bool,
) -> None:
    """Fit RUN... once more and write the calibration record: as found, as left, what was done.

    With a tolerance it says PASS or FAIL. What was written to the controller is found in the
    history beside the run's session; how the model was found, in the file of --model.
    """
    from app.files.runs import outside_runs
    from app.files.site import load_site
    from app.report.accuracy import Tolerance
    from app.report.build import Asked, write_report

    chosen = outs or OUT
    for out in chosen:
        outside_runs(out, runs)
    asked = Asked(
        add=add,
        model=model,
        mask=mask,
        before=before,
        after=after,
        site=load_site(site_file) if site_file is not None else None,
        tolerance=Tolerance(tolerance_um, tolerance_mdeg),
        title=title,
        number=number,
    )
    write_report(runs, asked, chosen)
    names = [str(out) for out in chosen]
    answer.show(
        {"format": "pkm-report/1", "file": names[0], "files": names},
        as_json,
        f"record in {' and '.join(names)}",
    )
