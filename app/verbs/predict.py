"""Predict the readings of other runs from a saved model; nothing is fitted again

How far off, against what noise and the model's own uncertainty explain.
"""

from pathlib import Path
from typing import Any

import click

from app import answer
from app.analysis_options import written_residuals
from app.show.chances import chance
from app.show.text_table import text_table
from calib.digits import fixed


@click.command()
@click.argument("model", type=click.Path(path_type=Path, dir_okay=False))
@click.argument("runs", nargs=-1, required=True, metavar="RUN...")
@click.option(
    "--frame",
    is_flag=True,
    help="Fit the place of the tracker to each RUN, and nothing else.  [default: as in MODEL]",
)
@click.option(
    "--out",
    type=answer.WrittenFile(),
    help="Write measured minus predicted of every reading to FILE (CSV).",
)
@answer.json_option
def command(
    model: Path, runs: tuple[str, ...], frame: bool, out: Path | None, as_json: bool
) -> None:
    """Predict the readings of RUN... from a saved MODEL that has not seen them.

    Geometry and effects stay as they are in MODEL, and so does the place of the tracker without
    --frame. RMS is told beside what noise and the model's own uncertainty would leave: a ratio of
    1 is a model that keeps what it says. No reading is left out as a stray.
    """
    from app.files.runs import outside_runs
    from app.jobs.predicting import predict

    outside_runs(out, runs)
    found = predict(model, runs, frame=frame)
    written_residuals(found, out)
    report = found.to_json()
    answer.show(report, as_json, words(report))


def words(report: dict[str, Any]) -> str:
    """Say a prediction to a person."""
    from app.show.record_words import excluded_lines, record_lines

    lines = [
        *record_lines(report),
        f"{report['readings']} readings; model {report['model']}, effects: "
        f"{', '.join(report['effects']) or 'none'}; place of the tracker: {report['frame']}",
        f"RMS {_um(report['rms_um'])}, expected {_um(report['expected_um'])} (noise alone "
        f"{_um(report['noise_um'])}): ratio {_number(report['ratio'])}",
        f"chi-square per degree of freedom {_number(report['chi2_per_dof'])}, "
        f"p = {chance(report['log10_p'])}",
        "",
        text_table(
            ("axis of the base", "mean um", "RMS um", "expected um"),
            [
                (a["axis"], _number(a["mean_um"]), _number(a["rms_um"]), _number(a["expected_um"]))
                for a in report["axes"]
            ],
        ),
        "",
        text_table(
            ("nest", "on", "readings", "RMS um", "expected um"),
            [
                (n["nest"], n["on"], str(n["readings"]), _number(n["rms_um"]),
                 _number(n["expected_um"]))
                for n in report["nests"]
            ],
        ),
        "",
        text_table(
            ("worst readings", "line", "nest", "dx um", "dy um", "dz um", "times expected"),
            [
                (w["pose"] or w["run"], str(w["line"]), w["nest"],
                 *(_number(v) for v in w["shift_um"]), _number(w["times_expected"]))
                for w in report["worst"]
            ],
        ),
    ]  # fmt: skip
    if report["not_in_model"]:
        named = ", ".join(report["not_in_model"])
        lines += ["", f"Not in the model, taken as drawn, uncertain by their tolerance: {named}"]
    if report["bad_readings"]:
        lines += ["", "Excluded readings:", *(f"  {line}" for line in excluded_lines(report))]
    if report["left_out_readings"]:
        lines += [
            "",
            f"{report['left_out_readings']} readings lack a channel or [load] of an effect",
        ]
    lines += [f"{one}." for one in report["remarks"]]
    return "\n".join([*lines, "", report["advice"]])


def _um(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} um"


def _number(value: float | None) -> str:
    return "-" if value is None else fixed(value, 2)
