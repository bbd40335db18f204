"""Add missing effects one by one and watch the error fall

Diagnose, add the best, refit, accept if held-out poses agree; see docs/effects.md.
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
from app.show.text_table import text_table
from app.verbs.diagnose import bad_lines, not_asked, not_there, sizes, um


@click.command()
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@model_options
@offer_options
@mask_option
@each_run_option
@click.option(
    "--save", type=answer.WrittenFile(), help="Write the model with what was found to FILE."
)
@residuals_option
@answer.json_option
def command(
    runs: tuple[str, ...],
    add: tuple[str, ...],
    model: Path | None,
    offer: tuple[Path, ...],
    site: Path | None,
    mask: tuple[str, ...],
    each_run: bool,
    save: Path | None,
    residuals: Path | None,
    as_json: bool,
) -> None:
    """Find the effects that RUN... calls for; those of --add and --model stay in.

    An effect is accepted only if poses that the fit has not seen are predicted no worse with it.
    """
    from app.files.runs import outside_runs
    from app.jobs.discovering import discover

    outside_runs(save, runs)
    outside_runs(residuals, runs)
    with answer.working("looking for effects, adding the best, fitting again"):
        found = discover(
            runs,
            add=add,
            model=model,
            offer=offers(offer, site),
            mask=mask,
            each_run=each_run,
            watch=watcher(),
        )
    if save is not None:
        found.save(save)
        answer.say(f"model written to {save}")
    written_residuals(found, residuals)
    report = found.to_json()
    answer.show(report, as_json, words(report))


def words(report: dict[str, Any]) -> str:
    """Say a discovery to a person: the staircase, what was found, what to do next."""
    from app.show.record_words import of_noise, record_lines

    steps = [
        (
            f"+ {step['added']}"
            if step["added"]
            else (f"- {step['removed']}" if step.get("removed") else "start"),
            um(step["rms_um"]),
            um(step["noise_floor_um"]),
            um(step["holdout_rms_um"]),
            um(step["holdout_floor_um"]),
            f"{step['chi2_per_dof']:.3f}",
            _chance(step),
        )
        for step in report["steps"]
    ]
    lines = [
        *record_lines(report),
        text_table(
            ("step", "RMS", "perfect", "held-out", "perfect", "chi2/dof", "p"),
            steps,
        ),
        *of_noise(report),
        "",
        *_in_the_model(report),
        *(f"  {line}" for line in sizes(report["parameters"])),
    ]
    if report["refused"]:
        refused = ", ".join(report["refused"])
        lines.append(f"Refused, held-out poses being predicted worse with it: {refused}")
    lines += [
        f"This run cannot tell apart: {', '.join(group)}" for group in report["indistinguishable"]
    ]
    lines += [
        f"Perhaps besides: {hint['effect']} (p = {hint['p_value']:.1g})" for hint in report["hints"]
    ]
    lines += [
        f"Refused, its value cannot be: {one['effect']} (p = {one['p_value']:.1g}), {one['value']}"
        for one in report["impossible"]
    ]
    if report["unexplained"]["significant"]:
        channels = ", ".join(report["unexplained"]["channels"])
        lines.append(f"Structure is left that no known effect explains; it depends on: {channels}")
    lines += [*bad_lines(report), "", report["advice"], *not_asked(report)]
    if report["unexplained"]["significant"]:
        lines += not_there(report)  # what nobody asked may be what is missing
    return "\n".join(lines)


def _chance(step: dict[str, Any]) -> str:
    """p-value of what was added; weak where chance may well do it."""
    if step.get("p_value") is None:
        return ""
    return f"{step['p_value']:.1g}{' (weak)' if step['weak'] else ''}"


def _in_the_model(report: dict[str, Any]) -> list[str]:
    """What the operator put in, and what was found beside it."""
    added = {step["added"] for step in report["steps"]}
    found = [name for name in report["effects"] if name in added]
    given = [name for name in report["effects"] if name not in added]
    told = [f"effects put in: {', '.join(given)}"] if given else []
    return [*told, f"effects found: {', '.join(found) or 'none'}"]
