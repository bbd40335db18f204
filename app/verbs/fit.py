"""Identify the machine's parameters from runs, with uncertainties

Maximum likelihood over the tracker's readings; see docs/architecture.md.
"""

from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis_options import mask_option, model_options, residuals_option, written_residuals
from app.show.chances import chance
from app.show.text_table import text_table
from calib.digits import Digits, fixed


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@model_options
@mask_option
@click.option(
    "--save", type=answer.WrittenFile(), help="Write the model with what was found to FILE."
)
@residuals_option
@answer.json_option
def command(
    runs: tuple[str, ...],
    add: tuple[str, ...],
    model: Path | None,
    mask: tuple[str, ...],
    save: Path | None,
    residuals: Path | None,
    as_json: bool,
) -> None:
    """Fit the machine's geometry, the tracker's place and the chosen effects to RUN...

    Several runs are fitted together: geometry and machine effects are shared, each run has its own
    place of the tracker. Nothing is written but the file named with --save.
    """
    from app.files.runs import outside_runs
    from app.jobs.fitting import fit

    outside_runs(save, runs)
    outside_runs(residuals, runs)
    found = fit(runs, add=add, model=model, mask=mask)
    if save is not None:
        found.save(save)
        answer.say(f"model written to {save}")
    written_residuals(found, residuals)
    report = found.to_json()
    answer.show(report, as_json, words(report))


def words(report: dict[str, Any]) -> str:
    """Say a fit to a person."""
    from app.show.record_words import excluded_lines, of_noise, record_lines

    lines = [
        *record_lines(report),
        f"{report['readings']} readings, effects: {', '.join(report['effects']) or 'none'}",
        "",
        text_table(("", "RMS", "perfect model"), _qualities(report)),
        *_kinds(report),
        f"chi-square per degree of freedom {report['chi2_per_dof']:.3f} (1 is perfect), "
        f"p = {chance(report['log10_p'])}",
        *of_noise(report),
        "",
        text_table(
            ("parameter", "value", "+-", "change", "in sigmas", "unit", ""),
            [_row(entry) for entry in report["parameters"]],
        ),
    ]
    if not report["settled"]:
        lines += ["", f"The fit has not settled in {report['steps']} steps: this is its best point"]
    if report["remarks"]:
        lines += ["", *report["remarks"]]
    if report["unidentified_words"]:
        lines += ["", *report["unidentified_words"]]
    if report["bad_readings"]:
        lines += ["", "Excluded readings:"]
        lines += [f"  {line}" for line in excluded_lines(report)]
    if report["left_out_readings"]:
        lines += [
            "",
            f"{report['left_out_readings']} readings lack a channel or [load] of an effect",
        ]
    for name, why in report["channels_left_aside"].items():
        lines += ["", f"Column {name} is not a channel: {why}"]
    return "\n".join(lines)


def _qualities(report: dict[str, Any]) -> list[tuple[str, ...]]:
    """All fitted readings; where some are on the base, those of the poses that are held out."""
    rows = [
        ("fitted readings", "rms_um", "noise_floor_um"),
        ("of these at poses", "platform_rms_um", "platform_floor_um"),
        ("held-out poses", "holdout_rms_um", "holdout_floor_um"),
    ]
    if report["platform_rms_um"] == report["rms_um"]:
        del rows[1]
    return [(name, _um(report[rms]), _um(report[floor])) for name, rms, floor in rows]


def _kinds(report: dict[str, Any]) -> list[str]:
    """One line for each kind of reading, where there are others than points."""
    kinds = report["by_kind"]
    if [one["kind"] for one in kinds] in ([], ["point"]):
        return []

    def said(value: float | None, unit: str) -> str:
        return "-" if value is None else f"{value:.2f} {unit}"

    rows = [
        (
            one["kind"],
            str(one["readings"]),
            said(one["rms"], one["unit"]),
            said(one["floor"], one["unit"]),
            said(one["ratio"], ""),
        )
        for one in kinds
    ]
    heads = ("kind", "readings", "RMS a component", "perfect model", "over perfect")
    return ["", text_table(heads, rows), ""]


def _um(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} um"


def _row(entry: dict[str, Any]) -> tuple[str, ...]:
    change = None if entry["nominal"] is None else entry["value"] - entry["nominal"]
    digits = Digits.of(entry["sigma"], entry["value"])
    means = entry.get("means", "")
    if means and entry["unit"] == "1":
        return (entry["name"], f"{entry['value']:.0f}", "", "", "", "", means)
    return (
        entry["name"],
        digits.text(entry["value"]),
        digits.text(entry["sigma"]),
        "" if change is None else digits.text(change, signed=True),
        ""
        if change is None or not entry["sigma"]
        else fixed(change / entry["sigma"], 1, signed=True),
        entry["unit"],
        means if entry["identified"] else "not identified",
    )


def _in_sigmas(ratio: float) -> str:
    return fixed(ratio, 1, signed=True)
