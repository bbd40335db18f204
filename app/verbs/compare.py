"""See where the model fails: residuals against everything, the loudest first

The residual of the fit is asked whether it depends on any state variable of the readings.
"""

from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis_options import model_options, residuals_option, watcher, written_residuals
from app.show.text_table import text_table
from calib.digits import Digits

SHOWN = 6
WIDTH = 13


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@model_options
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Draw figures (structure, workspace, actuators) into this folder.",
)
@click.option(
    "--propose",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Look for terms that would explain what is left; write them as effect files (TOML).",
)
@residuals_option
@answer.json_option
def command(
    runs: tuple[str, ...],
    add: tuple[str, ...],
    model: Path | None,
    out: Path | None,
    propose: Path | None,
    residuals: Path | None,
    as_json: bool,
) -> None:
    """Compare the fitted model with the readings of RUN...

    Repeatability first: what does not repeat, no effect can explain. Then what the residual
    depends on, the variable with the most structure first, and the actuators and poses that are
    off. Nothing is written but the figures asked for with --out and the effect files asked for
    with --propose, which --add takes.
    """
    from app.files.runs import outside_runs
    from app.jobs.comparing import compare

    outside_runs(out, runs)
    outside_runs(residuals, runs)
    if propose is not None:
        answer.say("looking for terms, too ...")
    found = compare(runs, add=add, model=model, propose=propose, watch=watcher())
    for path in [] if out is None else found.draw(out):
        answer.say(f"drawn {path}")
    for term in found.proposed:
        if term.file is not None:
            answer.say(f"written {term.file}")
    written_residuals(found, residuals)
    report = found.to_json()
    answer.show(report, as_json, words(report))


def words(report: dict[str, Any]) -> str:
    """Say a comparison to a person."""
    from app.show.record_words import excluded_lines, record_lines

    model = "baseline" + "".join(f" + {name}" for name in report["effects"])
    lines = [
        *record_lines(report),
        f"{report['readings']} readings; model: {model}",
        f"RMS {report['rms_um']:.2f} um (perfect model {report['noise_floor_um']:.2f} um), "
        f"chi-square per degree of freedom {report['chi2_per_dof']:.3f}",
        "",
        _repeats("repeats of poses", report["repeatability"]),
        _repeats("reference nests", report["reference_repeatability"]),
        "",
        "What the residual depends on (p pays for having looked at all of them):",
        text_table(
            ("variable", "p", "explains", "shows in", "period"),
            [_row(one) for one in report["structure"] if one["significant"]][:SHOWN]
            or [_row(one) for one in report["structure"]][:3],
        ),
    ]
    for one in [one for one in report["structure"] if one["significant"]][:2]:
        lines += ["", *_picture(one)]
    for one in report["together"]:
        if one["significant"]:
            how = "poses err as a whole" if one["channel"] == "pose" else "neighbours err alike"
            lines += ["", f"{how} ({one['channel']}, p = {one['p_value']:.2g})"]
    if report["actuators"]:
        lines += ["", "Residual in the actuators, RMS:"]
        lines.append(
            "  "
            + ", ".join(f"{a['actuator']} {a['rms']:.2f} {a['unit']}" for a in report["actuators"])
        )
    if "proposed" in report:
        lines += ["", *_terms(report["proposed"])]
    lines += [f"excluded: {line}" for line in excluded_lines(report)]
    return "\n".join([*lines, "", report["advice"]])


def _terms(proposed: list[dict[str, Any]]) -> list[str]:
    """Say which terms were found and how sure that is."""
    if not proposed:
        return ["No formula of the library would explain anything of what is left."]
    rows = [
        (
            one["formula"],
            f"{one['explains_um']:.2f} um",
            f"{100 * one['stability']:.0f} %",
            _held_out(one),
            one["file"] or "not written",
        )
        for one in proposed
    ]
    return [
        text_table(("proposed term", "explains", "found in halves", "unseen poses", "file"), rows)
    ]


def _held_out(one: dict[str, Any]) -> str:
    before, after = one["held_out_before_um"], one["held_out_um"]
    if before is None or after is None:
        return "cannot be fitted"
    return f"{before:.2f} -> {after:.2f} um"


def _repeats(what: str, repeats: dict[str, Any] | None) -> str:
    if repeats is None:
        return f"{what}: none, so nothing is known of repeatability"
    return (
        f"{what}: scatter {repeats['times_stated_sigma']:.2f} x the stated uncertainty "
        f"({repeats['dof']} degrees of freedom, p = {repeats['p_value']:.2g}); "
        f"{100 * repeats['unrepeatable_part_of_misfit']:.0f} % of the misfit does not repeat"
    )


def _row(one: dict[str, Any]) -> tuple[str, ...]:
    return (
        one["channel"],
        f"{one['p_value']:.2g}",
        f"{one['explains_um']:.2f} um",
        one["shows_in"],
        "" if one["period"] is None else f"{one['period']:.4g}",
    )


def _picture(one: dict[str, Any]) -> list[str]:
    """Draw the bins of a dependence as bars to the left and right of zero."""
    largest = max((abs(each["value"]) for each in one["bins"]), default=0.0) or 1.0
    folded = "" if one["period"] is None else f" modulo {one['period']:.4g}"
    lines = [f"{one['shows_in']} against {one['channel']}{folded}, {one['unit']}:"]
    for each in one["bins"]:
        length = round(WIDTH * abs(each["value"]) / largest)
        left = ("#" * length if each["value"] < 0 else "").rjust(WIDTH)
        right = ("#" * length if each["value"] > 0 else "").ljust(WIDTH)
        span = f"{each['from']:.4g}"
        if each["to"] != each["from"]:
            span += f" .. {each['to']:.4g}"
        digits = Digits.of(each["sigma"], each["value"])
        value = digits.text(each["value"], signed=True)
        lines.append(f"  {span:>22}  {left}|{right} {value:>8} +- {digits.text(each['sigma'])}")
    return lines
