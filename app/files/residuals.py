"""Residuals of every reading as a table (CSV), for other programs: nothing reads it back."""

import csv
import io
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from app.files.runs import outside_runs
from calib.arrays import Array
from calib.identify import Fit
from calib.identify.readings import BadReading
from calib.model.prediction import Model
from calib.model.state import Linearised
from calib.runs.sensed import kind_words
from calib.runs.stack import Rows

LACKS = "lacks a channel that an effect needs"
HEADER = (
    "run", "line", "pose", "nest", "on", "time_s",
    "x_mm", "y_mm", "z_mm", "dx_um", "dy_um", "dz_um", "distance_um",
    "base_dx_um", "base_dy_um", "base_dz_um", "sigmas", "left_out", "kind",
)  # fmt: skip
"""Columns: where the reading stands; what was read, and measured minus predicted in the tracker
frame; the same along the axes of the base frame; in stated sigmas; why it was left out; the kind.
Readings that are no points have their components in x, y, z as the run has them, in mm and um, or
rad and urad, and none along the axes of the base; components that they lack are empty."""


def write_residuals(
    path: Path,
    model: Model,
    linear: Linearised,
    bad: Iterable[BadReading],
    runs: tuple[str, ...],
) -> None:
    """Write a line for each reading of the model, those left out as well, with the reason.

    Raises
    ------
    BadInput
        If the file would lie in a run's folder.
    """
    outside_runs(path, runs)
    why = {int(row): LACKS for row in np.flatnonzero(model.lacking)}
    why.update({one.row: one.why for one in bad})
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(residuals_text(model, linear, why), encoding="utf-8", newline="\n")


def residuals_of_fit(path: Path, fit: Fit, runs: tuple[str, ...]) -> None:
    """The same of a fit."""
    write_residuals(path, fit.model, fit.linear, fit.bad, runs)


def residuals_text(model: Model, linear: Linearised, why: dict[int, str]) -> str:
    """The table as text; ``why`` readings (indices) were left out."""
    rows = model.rows
    in_base = np.einsum("kin,kn->in", linear.situation.frame_rotation, linear.residual)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    for k in np.flatnonzero(~rows.ghost).tolist():
        angular = rows.sensed is not None and bool(rows.sensed.angular[k])
        live = rows.live[:, k]
        off = np.where(live, (1e6 if angular else 1e3) * linear.residual[:, k], np.nan)
        writer.writerow(
            [
                rows.runs[rows.run[k]].source,
                rows.line[k],
                rows.pose_name[k],
                rows.nest_name[k],
                "platform" if rows.on_platform[k] else "base",
                f"{rows.time_s[k]:.10g}",
                *(
                    f"{value:.9g}" if held else ""
                    for value, held in zip(rows.position[:, k], live, strict=True)
                ),
                *_um(off),
                *_um(np.array([np.linalg.norm(off[live])])),
                *_um(1000.0 * in_base[:, k] if rows.placed[k] else np.full(3, np.nan)),
                f"{np.linalg.norm(linear.whitened[:, k]):.4g}",
                why.get(k, ""),
                _kind(rows, k),
            ]
        )
    return text.getvalue()


def _um(values: Array) -> list[str]:
    return ["" if np.isnan(value) else f"{value:.4f}" for value in values]


def _kind(rows: Rows, k: int) -> str:
    if rows.sensed is None:
        return "point"
    return kind_words(int(rows.sensed.kind[k]), bool(rows.sensed.turn[k]))
