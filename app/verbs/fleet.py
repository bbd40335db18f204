"""Fit many machines of one type, see what is usual and who is not like the others

Each is fitted alone, then with what all have in common; see docs/fleet.md.
"""

from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis_options import progress, spread_options
from app.show.text_table import text_table

FEW = 12
"""Parameters that are shown: those with the largest spread for their tolerance."""


@click.group()
def command() -> None:
    """Work on many machines of one type."""


@command.command()
@click.argument("folders", nargs=-1, required=True, metavar="FOLDER...")
@click.option("--add", multiple=True, metavar="EFFECT", help="Put an effect in the model.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder that keeps every machine's answer: what is there is not computed again.",
)
@click.option("--report", type=answer.WrittenFile(), help="Write a page (.html or .pdf).")
@spread_options
@answer.json_option
def fit(
    folders: tuple[str, ...],
    add: tuple[str, ...],
    out: Path | None,
    report: Path | None,
    workers: int | None,
    scheduler: str,
    as_json: bool,
) -> None:
    """Fit the machines whose runs are FOLDER..., or lie in them, one run of each.

    Every machine is fitted alone; from all together it is learnt what is usual, and how far
    machines differ; each machine is then told with that as prior. Machines that differ by more
    than chance, of all machines and parameters together, are named. The answer is the same by
    whatever processes it is computed. What was stopped goes on with the same --out.
    """
    from app.jobs.fleet import fit_fleet

    if report is not None and report.suffix not in (".html", ".pdf"):
        raise click.BadParameter("a page ends in .html or .pdf", param_hint="--report")
    with progress() as watch:
        found = fit_fleet(
            folders, add=add, out=out, workers=workers, scheduler=scheduler, watch=watch
        ).to_json()
    if report is not None:
        _write(found, report)
        answer.say(f"written to {report}")
    answer.show(found, as_json, words(found))


def _write(found: dict[str, Any], path: Path) -> None:
    from app.report.fleet_page import fleet_page
    from app.report.html import html_of
    from app.report.pdf import pdf_of

    page = fleet_page(found)
    if path.suffix == ".pdf":
        path.write_bytes(pdf_of(page))
    else:
        path.write_text(html_of(page), encoding="utf-8")


def words(report: dict[str, Any]) -> str:
    """Say a fleet to a person."""
    from app.report.fleet_page import machine_row, outlier_lines, parameter_row

    heads = ("machine", "readings", "left out", "RMS um", "perfect", "held-out", "chi2/dof", "")
    wide = sorted(report["parameters"], key=lambda one: -one["spread"] / one["tolerance"])
    said = outlier_lines(report)
    few = wide[:FEW]
    return "\n".join(
        [
            f"{len(report['machines'])} of {report['machine']}, effects: "
            f"{', '.join(report['effects']) or 'none'}",
            "",
            text_table(heads, [machine_row(one) for one in report["machines"]]),
            "",
            f"What is usual, the {len(few)} parameters with most spread for their tolerance "
            "(standard deviations):",
            text_table(
                ("parameter", "unit", "nominal", "usual", "spread", "tolerance", ""),
                [parameter_row(one) for one in few],
            ),
            "",
            *(("Not like the others:", *(f"  {one}" for one in said)) if said else
              ("No machine differs from the others by more than chance.",)),
            *report["remarks"],
        ]
    )  # fmt: skip
