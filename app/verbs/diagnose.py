"""Ask which physical effect the model misses

The candidates are scored against what the fit leaves; see docs/effects.md.
"""

from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis_options import (
    each_run_option,
    mask_option,
    model_options,
    offer_options,
    offers,
    residuals_option,
    watcher,
    written_residuals,
)
from app.show.sizes import size_text
from app.show.text_table import text_table


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@model_options
@offer_options
@residuals_option
@mask_option
@each_run_option
@answer.json_option
def command(
    runs: tuple[str, ...],
    add: tuple[str, ...],
    model: Path | None,
    offer: tuple[Path, ...],
    site: Path | None,
    residuals: Path | None,
    mask: tuple[str, ...],
    each_run: bool,
    as_json: bool,
) -> None:
    """Score every known effect against what the model leaves of RUN...

    The answer says which effect is missing, how sure that is, how large it is and what adding it
    would bring; or that nothing is missing; or that something unknown is.
    """
    from app.files.runs import outside_runs
    from app.jobs.discovering import diagnose

    outside_runs(residuals, runs)
    with answer.working("testing every known effect"):
        asked = diagnose(
            runs,
            add=add,
            model=model,
            offer=offers(offer, site),
            mask=mask,
            each_run=each_run,
            watch=watcher(),
        )
    written_residuals(asked, residuals)
    report = asked.to_json()
    answer.show(report, as_json, words(report))


def words(report: dict[str, Any]) -> str:
    """Say a diagnosis to a person."""
    from app.show.record_words import of_noise, record_lines

    base = report["baseline"]
    lines = [
        *record_lines(report),
        f"model: baseline{''.join(' + ' + name for name in base['effects'])}",
        f"RMS {um(base['rms_um'])} (perfect model {um(base['noise_floor_um'])}), held-out poses "
        f"{um(base['holdout_rms_um'])} (perfect {um(base['holdout_floor_um'])}), "
        f"chi-square per degree of freedom {base['chi2_per_dof']:.3f}",
        *of_noise(report),
        "",
        text_table(
            ("effect", "p", "RMS after", "held-out after", "visible", "size"),
            [_row(candidate) for candidate in report["candidates"]],
        ),
    ]
    for group in report["indistinguishable"]:
        lines += ["", f"This run cannot tell apart: {', '.join(group)}"]
    if report["unexplained"]["significant"]:
        channels = ", ".join(report["unexplained"]["channels"])
        lines += ["", f"Structure is left that no known effect explains; it depends on: {channels}"]
    lines += [*bad_lines(report), "", report["advice"]]
    lines += not_asked(report)
    return "\n".join([*lines, *not_there(report)])


def not_there(report: dict[str, Any]) -> list[str]:
    """Effects that the machine file does not make askable."""
    lacking = ", ".join(report["not_on_this_machine"])
    told = f"(not on this machine: {lacking}; pkmcal machine check says why)"
    return [told] if lacking else []


def um(value: float | None) -> str:
    """Micrometres, or a dash."""
    return "-" if value is None else f"{value:.2f} um"


def bad_lines(report: dict[str, Any]) -> list[str]:
    """Excluded readings, one a line or in ranges."""
    from app.show.record_words import excluded_lines

    if not report["bad_readings"]:
        return []
    return ["", "Excluded readings:", *(f"  {line}" for line in excluded_lines(report))]


def not_asked(report: dict[str, Any]) -> list[str]:
    """Effects that these readings cannot show, one a line."""
    return [f"(not asked: {name}, {why})" for name, why in report["unavailable"].items()]


def sizes(parameters: list[dict[str, Any]]) -> list[str]:
    """Values with uncertainties in words; what a number stands for, where it is one of a few."""
    return [f"{p['name']} = {size_text(p)}" for p in parameters]


def _row(candidate: dict[str, Any]) -> tuple[str, ...]:
    found = sizes(candidate["parameters"])
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return (
        candidate["effect"],
        f"{candidate['p_value']:.2g}",
        um(candidate["rms_after_um"]),
        um(candidate["holdout_rms_after_um"]),
        f"{100 * candidate['visible']:.0f} %",
        (found[0] + more) if candidate["p_value"] < 0.05 else "",
    )
