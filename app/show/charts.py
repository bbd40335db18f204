"""Figures of the analysis verbs (matplotlib, no window)."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from calib.analysis.sensitivity import Index
from calib.errors import BadInput

matplotlib.use("Agg")
LENGTH, ANGLE = "#1f6f8b", "#c8553d"


def save(figure: Figure, path: Path) -> None:
    """Write a figure; an ending that matplotlib does not know is bad input."""
    try:
        figure.savefig(path, dpi=150)
    except ValueError as wrong:
        raise BadInput(str(wrong), place=str(path), remedy="Use .png, .svg or .pdf.") from wrong


def sensitivity_chart(indices: Sequence[Index], machine: str, path: Path) -> None:
    """Bar charts with error bars like Feng et al. 2022, Fig. 3, and Zhang et al. 2018, Figs. 4, 5.

    Position and orientation, per mm and per deg of error, apart.
    """
    degree = np.deg2rad(1.0)
    figure = Figure(figsize=(max(8.0, 0.16 * len(indices) + 4.0), 7.0), layout="constrained")
    axes = figure.subplots(2, 2)
    for column, (unit, factor, colour) in enumerate((("mm", 1.0, LENGTH), ("rad", degree, ANGLE))):
        held = [i for i in indices if i.unit == unit]
        names = [i.name for i in held]
        per = "mm" if unit == "mm" else "deg"
        for row, (what, mean, spread, scale) in enumerate(
            (
                (f"position, mm per {per}", "position", "position_spread", 1.0),
                (f"orientation, deg per {per}", "orientation", "orientation_spread", degree),
            )
        ):
            axis = axes[row, column]
            heights = [getattr(i, mean) * factor / scale for i in held]
            errors = [getattr(i, spread) * factor / scale for i in held]
            axis.bar(names, heights, yerr=errors, color=colour, capsize=2, width=0.7)
            axis.set_ylabel(what)
            axis.tick_params(axis="x", rotation=90, labelsize=8 if len(names) < 30 else 5)
            axis.grid(axis="y", alpha=0.3)
            if not held:
                axis.set_axis_off()
    figure.suptitle(f"{machine}: sensitivity of the pose, mean and spread over the workspace")
    save(figure, path)
