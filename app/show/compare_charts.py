"""Figures of ``compare``: the dependences that speak, the workspace, the actuators."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.show.charts import ANGLE, LENGTH, save
from calib.discover.compare import RunComparison
from calib.discover.compare_report import acts_on, factor_of
from calib.evidence.compare import Speaking

MOST_PANELS = 6


def write_charts(found: RunComparison, folder: Path) -> list[Path]:
    """Write structure.png, workspace.png and actuators.png; returns what was written."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, draw in (
        ("structure.png", _structure),
        ("workspace.png", _workspace),
        ("actuators.png", _actuators),
    ):
        figure = draw(found)
        if figure is not None:
            save(figure, folder / name)
            written.append(folder / name)
    return written


def _structure(found: RunComparison) -> Figure | None:
    """Added-variable pictures of the variables that speak; the first two if none does."""
    shown = [one for one in found.speaking if one.significant and one.bins][:MOST_PANELS]
    shown = shown or [one for one in found.speaking if one.bins][:2]
    if not shown:
        return None
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure = Figure(figsize=(4.2 * columns, 3.2 * lines), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False).reshape(-1)
    for axis, one in zip(panels, shown, strict=False):
        _dependence(axis, found, one)
    for axis in panels[len(shown) :]:
        axis.set_axis_off()
    return figure


def _dependence(axis: Axes, found: RunComparison, one: Speaking) -> None:
    factor, unit = factor_of(one.unit)
    middle = np.array([0.5 * (each.low + each.high) for each in one.bins])
    value = factor * np.array([each.value for each in one.bins])
    sigma = factor * np.array([each.sigma for each in one.bins])
    axis.axhline(0.0, color="0.6", linewidth=0.8)
    axis.errorbar(middle, value, yerr=sigma, fmt="o-", color=LENGTH, capsize=3)
    axis.set_xlabel(f"{one.channel} modulo {one.period:.4g}" if one.period else one.channel)
    axis.set_ylabel(f"{acts_on(found, one)}, {unit}")
    axis.set_title(f"p = {one.p_value:.2g}", fontsize=9)


def _workspace(found: RunComparison) -> Figure:
    """Mean residual of every pose, seen from above and from the side."""
    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    position, shift = found.poses.position, 1000.0 * found.poses.shift
    typical = float(np.sqrt(np.mean(np.sum(shift**2, axis=0)))) or 1.0
    span = float(np.max(np.ptp(position, axis=1))) or 1.0
    for axis, (across, up) in zip(figure.subplots(1, 2), ((0, 1), (0, 2)), strict=True):
        arrows = axis.quiver(
            position[across], position[up], shift[across], shift[up],
            angles="xy", scale_units="xy", scale=12.0 * typical / span, color=ANGLE, width=0.004,
        )  # fmt: skip
        if up == 2:
            axis.quiverkey(arrows, 0.8, 1.04, typical, f"{typical:.1f} um", labelpos="E")
        axis.set_xlabel(f"{'xyz'[across]}, mm")
        axis.set_ylabel(f"{'xyz'[up]}, mm")
        axis.set_aspect("equal", "datalim")
        axis.grid(alpha=0.3)
    figure.suptitle("residual of every pose, base frame", fontsize=10)
    return figure


def _actuators(found: RunComparison) -> Figure | None:
    """Error of each actuator that explains a pose's readings best, against its coordinate."""
    actuators = found.fit.model.rows.machine.actuators
    known = np.isfinite(found.poses.extension).all(axis=0)
    if not known.any():
        return None
    columns = min(3, len(actuators))
    lines = -(-len(actuators) // columns)
    figure = Figure(figsize=(3.6 * columns, 2.6 * lines), layout="constrained", dpi=120)
    panels = figure.subplots(lines, columns, squeeze=False, sharey=True).reshape(-1)
    for index, (axis, actuator) in enumerate(zip(panels, actuators, strict=False)):
        factor, unit = factor_of(actuator.unit)
        axis.axhline(0.0, color="0.6", linewidth=0.8)
        axis.plot(
            found.poses.q[index, known], factor * found.poses.extension[index, known],
            ".", color=LENGTH,
        )  # fmt: skip
        axis.set_title(actuator.name, fontsize=9)
        axis.set_xlabel(f"q{index + 1}, {actuator.unit}")
        axis.set_ylabel(unit)
    for axis in panels[len(actuators) :]:
        axis.set_axis_off()
    return figure
