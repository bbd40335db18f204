"""Figures of a report, by matplotlib, as data addresses that a page can carry within itself."""

import base64
import io
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calib.arrays import Array

BEFORE, AFTER, PALE, INK = "#c2571a", "#1b6e8c", "#d9dde1", "#22303a"
_STYLE: dict[Any, Any] = {
    "font.size": 9,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "grid.color": "#e6e9ec",
    "axes.axisbelow": True,
    "svg.hashsalt": "pkmcal",
    "legend.frameon": False,
}


def as_data_address(figure: Figure) -> str:
    """The figure as an SVG in a ``data:`` address."""
    out = io.BytesIO()
    with mpl.rc_context(_STYLE):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(out.getvalue()).decode("ascii")


def new_figure(
    width: float, height: float, rows: int = 1, columns: int = 1
) -> tuple[Figure, list[Axes]]:
    """An empty figure in the report's style; sizes in inches."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False)
    return figure, list(axes.ravel())


def _legend_above(axis: Axes) -> None:
    """A legend that never covers data."""
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1)


def errors_by_pose(
    series: Sequence[tuple[str, Array, Array]], paper: tuple[float, float] | None = None
) -> Figure:
    """Position (mm) and orientation (deg) error of every pose, one colour a series, log scale.

    ``series`` holds (label, position (N,), orientation (N,)); ``paper`` the published peaks.
    """
    figure, (top, bottom) = new_figure(7.4, 4.6, rows=2)
    for (label, position, orientation), colour in zip(series, (BEFORE, AFTER, INK), strict=False):
        number = np.arange(1, len(position) + 1)
        top.semilogy(number, position, ".", ms=4, color=colour, label=label)
        bottom.semilogy(number, orientation, ".", ms=4, color=colour)
    for axis, unit, published in (
        (top, "position error, mm", paper[0] if paper else None),
        (bottom, "orientation error, deg", paper[1] if paper else None),
    ):
        axis.set_ylabel(unit)
        if published:
            axis.axhline(published, color=INK, lw=0.8, ls="--")
            axis.annotate(
                f"published peak {published:g}",
                (1.0, published),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                fontsize=8,
            )
    bottom.set_xlabel("verification pose")
    _legend_above(top)
    return figure


def parameter_changes(
    names: Sequence[str], changes: Array, sigmas: Array, tolerances: Array, unit: str
) -> Figure:
    """Identified minus nominal with one standard uncertainty, over the tolerance band."""
    figure, (axis,) = new_figure(7.4, 2.9)
    number = np.arange(len(names))
    axis.bar(number, 2 * tolerances, bottom=-tolerances, width=0.9, color=PALE, label="tolerance")
    axis.errorbar(
        number,
        changes,
        yerr=sigmas,
        fmt="o",
        ms=3,
        lw=1,
        color=AFTER,
        label="identified, 1 sigma",
    )
    axis.set_xticks(number, names, rotation=90, fontsize=6)
    axis.set_ylabel(f"identified - nominal, {unit}")
    axis.set_xlim(-0.8, len(names) - 0.2)
    _legend_above(axis)
    return figure


def workspace_map(position: Array, before: Array, after: Array) -> Figure:
    """Where the error sits: largest error at each node, before and after, by height.

    ``position`` (3, N) in mm, errors (N,) in mm.
    """
    heights = np.unique(np.round(position[2], 3))
    figure, axes = new_figure(7.4, 4.8, rows=2, columns=len(heights))
    for row, (label, error) in enumerate((("before", before), ("after", after))):
        worst = _by_node(position, error)
        top = max(value for value in worst.values())
        for column, height in enumerate(heights):
            axis = axes[row * len(heights) + column]
            nodes = [(x, y, e) for (x, y, z), e in worst.items() if z == height]
            x, y, e = np.array(nodes).T
            dots = axis.scatter(x, y, c=e * 1e3, s=260, cmap="viridis", vmin=0, vmax=top * 1e3)
            for a, b, value in nodes:
                axis.annotate(
                    f"{value * 1e3:.0f}" if row == 0 else f"{value * 1e3:.1f}",
                    (a, b),
                    ha="center",
                    va="center",
                    fontsize=6.5,
                    color="white" if value < 0.6 * top else "black",
                )
            axis.margins(0.25)
            axis.set_title(f"{label}, z = {height:g} mm", fontsize=8.5)
            axis.set_xlabel("x, mm" if row else "")
            axis.set_ylabel("y, mm" if column == 0 else "")
            axis.set_aspect("equal")
            if column == len(heights) - 1:
                figure.colorbar(dots, ax=axis, label="um", shrink=0.8)
    return figure


def _by_node(position: Array, error: Array) -> dict[tuple[float, float, float], float]:
    worst: dict[tuple[float, float, float], float] = {}
    for column, value in zip(np.round(position, 3).T, error, strict=True):
        key = (float(column[0]), float(column[1]), float(column[2]))
        worst[key] = max(worst.get(key, 0.0), float(value))
    return worst


def drift(times: Mapping[str, Array], shifts: Mapping[str, Array]) -> Figure:
    """Distance of each base nest from its first reading, mm, over the run's time in s."""
    figure, (axis,) = new_figure(7.4, 2.4)
    for nest in times:
        axis.plot(times[nest] / 60.0, shifts[nest] * 1e3, "o-", ms=3, lw=1, label=f"nest {nest}")
    axis.set_xlabel("machine time, min")
    axis.set_ylabel("shift, um")
    axis.set_ylim(bottom=0)
    _legend_above(axis)
    return figure


def residual_cloud(residual_um: Array, floor_um: float) -> Figure:
    """3D residual of every reading in the order of measuring, against the noise floor (um)."""
    figure, (axis,) = new_figure(7.4, 2.4)
    axis.plot(np.arange(1, len(residual_um) + 1), residual_um, ".", ms=4, color=AFTER)
    axis.axhline(floor_um, color=INK, lw=0.8, ls="--", label=f"noise floor {floor_um:.1f} um RMS")
    axis.set_xlabel("reading")
    axis.set_ylabel("distance, um")
    axis.set_ylim(bottom=0)
    _legend_above(axis)
    return figure
