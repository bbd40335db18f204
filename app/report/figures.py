"""Figures of a record, by matplotlib, as SVG texts that a page can carry within itself."""

import io
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from calib.arrays import Array

BEFORE, AFTER, PALE, INK = "#c2571a", "#1b6e8c", "#d9dde1", "#22303a"
_MAP = LinearSegmentedColormap.from_list("error", ["#e8eef2", "#8fb8c9", AFTER, "#0d3a4b"])
_STYLE: dict[Any, Any] = {
    "font.size": 8,
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


def as_svg(figure: Figure) -> str:
    """The figure as an SVG text."""
    out = io.BytesIO()
    with mpl.rc_context(_STYLE):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue().decode("utf-8")


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
    axis.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1, frameon=False,
        fontsize=8,
    )  # fmt: skip


def errors_by_pose(
    series: Sequence[tuple[str, Sequence[str], Array, Array]],
    tolerances: tuple[float | None, float | None] = (None, None),
) -> Figure:
    """Position (um) and orientation (mdeg) error of every pose, one colour a series, log scale.

    ``series`` holds (name, labels, position (N,), orientation (N,)); a pose that several have
    visited stands at one place.
    """
    places = {label: 1 for _, labels, *_ in series for label in labels}
    places = {label: number for number, label in enumerate(places, start=1)}
    figure, (top, bottom) = new_figure(7.0, 4.2, rows=2)
    colours = (BEFORE, AFTER) if len(series) > 1 else (AFTER,)
    for (name, labels, position, orientation), colour in zip(series, colours, strict=False):
        number = [places[label] for label in labels]
        top.semilogy(number, position, ".", ms=4, color=colour, label=name)
        bottom.semilogy(number, orientation, ".", ms=4, color=colour)
    for axis, unit, limit in (
        (top, "position error, µm", tolerances[0]),
        (bottom, "orientation error, mdeg", tolerances[1]),
    ):
        axis.set_ylabel(unit)
        axis.set_xlim(0, len(places) + 1)
        axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.yaxis.set_minor_formatter(NullFormatter())
        if limit:
            axis.axhline(limit, color=INK, lw=0.8, ls="--")
    bottom.set_xlabel("verification pose")
    _legend_above(top)
    return figure


def parameter_changes(
    names: Sequence[str], changes: Array, expanded: Array, tolerances: Array, unit: str
) -> Figure:
    """Identified minus nominal with expanded uncertainties, over the tolerance band."""
    figure, (axis,) = new_figure(7.0, 2.5)
    number = np.arange(len(names))
    axis.bar(number, 2 * tolerances, bottom=-tolerances, width=0.9, color=PALE, label="tolerance")
    axis.errorbar(
        number,
        changes,
        yerr=expanded,
        fmt="o",
        ms=3,
        lw=1,
        color=AFTER,
        label="identified, k = 2",
    )
    axis.set_xticks(number, names, rotation=90, fontsize=6)
    axis.set_ylabel(f"identified − nominal, {unit}")
    axis.set_xlim(-0.8, len(names) - 0.2)
    _legend_above(axis)
    return figure


def workspace_maps(series: Sequence[tuple[str, Array, Array]]) -> Figure:
    """Where the error sits: largest error (um) at each place, a row a series, a column a height.

    ``series`` holds (name, positions (3, N) in mm, errors (N,) in um). Heights that are many are
    put together in three bands.
    """
    bands = _bands(np.concatenate([position[2] for _, position, _ in series]))
    figure, axes = new_figure(7.0, 2.35 * len(series), rows=len(series), columns=len(bands))
    for row, (name, position, error) in enumerate(series):
        worst = _by_node(position, error)
        top = max(worst.values())
        for column, (low, high) in enumerate(bands):
            axis = axes[row * len(bands) + column]
            nodes = [(x, y, e) for (x, y, z), e in worst.items() if low <= z <= high]
            axis.set_title(f"{name}, z = {_band_words(low, high)} mm", fontsize=8)
            axis.margins(0.25)
            axis.set_xlabel("x, mm" if row == len(series) - 1 else "")
            axis.set_ylabel("y, mm" if column == 0 else "")
            axis.set_aspect("equal")
            if not nodes:
                continue
            x, y, e = np.array(nodes).T
            dots = axis.scatter(x, y, c=e, s=230, cmap=_MAP, vmin=0, vmax=top)
            for a, b, value in nodes if len(nodes) <= 16 else ():
                colour = "white" if value > 0.42 * top else INK
                axis.annotate(
                    f"{value:.0f}" if top >= 100 else f"{value:.1f}", (a, b), ha="center",
                    va="center", fontsize=6, color=colour,
                )  # fmt: skip
            if column == len(bands) - 1:
                figure.colorbar(dots, ax=axis, label="µm", shrink=0.8)
    return figure


def _bands(heights: Array) -> list[tuple[float, float]]:
    """Heights one by one where they are few, else three bands of them."""
    levels = np.unique(np.round(heights, 3))
    if levels.size <= 3:
        return [(float(z), float(z)) for z in levels]
    edges = np.linspace(levels[0], levels[-1], 4)
    return [(float(a), float(b)) for a, b in pairwise(edges)]


def _band_words(low: float, high: float) -> str:
    return f"{low:g}" if low == high else f"{low:.0f} to {high:.0f}"


def _by_node(position: Array, error: Array) -> dict[tuple[float, float, float], float]:
    worst: dict[tuple[float, float, float], float] = {}
    for column, value in zip(np.round(position, 3).T, error, strict=True):
        key = (float(column[0]), float(column[1]), float(column[2]))
        worst[key] = max(worst.get(key, 0.0), float(value))
    return worst


def drift(series: Mapping[str, tuple[Array, Array]], limit_um: float | None = None) -> Figure:
    """Distance (um) of each base nest from its first reading, over the run's time in s.

    ``series`` holds times (K,) and distances (K,) by the name of the nest, and of the run where
    there are several.
    """
    figure, (axis,) = new_figure(7.0, 2.2)
    for name, (times, shifts) in series.items():
        axis.plot(times / 60.0, shifts, "o-", ms=3, lw=1, label=name if len(series) <= 8 else None)
    if limit_um is not None:
        axis.axhline(limit_um, color=INK, lw=0.8, ls="--")
    axis.set_xlabel("machine time, min")
    axis.set_ylabel("shift, µm")
    axis.set_ylim(bottom=0)
    if len(series) <= 8:
        _legend_above(axis)
    return figure


def staircase(names: Sequence[str], series: Sequence[tuple[str, Array, Array]]) -> Figure:
    """RMS (um) of each model on the way, and what a perfect one would leave.

    ``series`` holds (name, RMS (K,), floor (K,)).
    """
    figure, (axis,) = new_figure(7.0, 2.2)
    edges = np.arange(len(names) + 1) - 0.5
    for (name, rms, floor), colour in zip(series, (AFTER, BEFORE), strict=False):
        axis.stairs(rms, edges, baseline=None, lw=2.2, color=colour, label=name)
        axis.stairs(floor, edges, baseline=None, lw=0.9, ls="--", color=colour)
    axis.set_xticks(np.arange(len(names)), names)
    axis.set_ylabel("RMS, µm")
    axis.set_ylim(bottom=0)
    axis.set_xlim(edges[0], edges[-1])
    axis.grid(visible=False, axis="x")
    _legend_above(axis)
    return figure


def residual_cloud(residual_um: Array, floor_um: float) -> Figure:
    """3D residual of every reading in the order of measuring, against the noise floor (um)."""
    figure, (axis,) = new_figure(7.0, 2.0)
    axis.plot(np.arange(1, len(residual_um) + 1), residual_um, ".", ms=4, color=AFTER)
    axis.axhline(floor_um, color=INK, lw=0.8, ls="--", label=f"noise floor {floor_um:.1f} µm RMS")
    axis.set_xlabel("reading")
    axis.set_ylabel("distance, µm")
    axis.set_ylim(bottom=0)
    _legend_above(axis)
    return figure
