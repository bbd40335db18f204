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

LACKS = "lacks a channel that an effect needs"
HEADER = (
    "run", "line", "pose", "nest", "on", "time_s",
    "x_mm", "y_mm", "z_mm", "dx_um", "dy_um", "dz_um", "distance_um",
    "base_dx_um", "base_dy_um", "base_dz_um", "sigmas", "left_out",
)  # fmt: skip
"""Columns: where the reading stands; what was read, and measured minus predicted in the tracker
frame; the same along the axes of the base frame; in stated sigmas; why it was left out."""


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
    why = {int(row): LACKS for row in np.flatnonzero(~model.usable)}
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
    for k in range(rows.count):
        off = 1000.0 * linear.residual[:, k]
        writer.writerow(
            [
                rows.runs[rows.run[k]].source,
                rows.line[k],
                rows.pose_name[k],
                rows.nest_name[k],
                "platform" if rows.on_platform[k] else "base",
                f"{rows.time_s[k]:.10g}",
                *(f"{value:.7g}" for value in rows.position[:, k]),
                *_um(off),
                *_um(np.array([np.linalg.norm(off)])),
                *_um(1000.0 * in_base[:, k]),
                f"{np.linalg.norm(linear.whitened[:, k]):.4g}",
                why.get(k, ""),
            ]
        )
    return text.getvalue()


def _um(values: Array) -> list[str]:
    return [f"{value:.4f}" for value in values]
