"""Plots that grow while the machine measures: decimated, redrawn only when there is news."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from textual_hires_canvas import Canvas
from textual_plot import HiResMode, PlotWidget
from textual_plot.axis_formatter import NumericAxisFormatter

from app.tui.parts import Point
from app.tui.theme import BASE, SERIES, tinted
from app.tui.wording import micro

MOST = 400
"""More points than this cannot be told apart on a terminal."""

Array = NDArray[np.float64]


class Spaced(NumericAxisFormatter):
    """Round numbers along an upright axis, no two on neighbouring lines: each is where it says."""

    def __init__(self, plot: PlotWidget) -> None:
        super().__init__()
        self._plot = plot

    def get_ticks(self, min_: float, max_: float, max_ticks: int = 8) -> list[float]:
        """As many as the plot's lines allow."""
        return few_ticks(min_, max_, max(2, min(max_ticks, self._plot.size.height // 2 - 2)))


class QuietPlot(PlotWidget):
    """A plot that leaves the keys to the screen and has small margins."""

    def __init__(self, title: str, *, id: str) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id, allow_pan_and_zoom=False)
        self.can_focus = False
        self.border_title = title
        self._drawn: object = None

    def on_mount(self) -> None:
        """Keep the margins small: a terminal has few lines."""
        self.margin_left = 6
        self.margin_bottom = 1
        self.margin_top = 0
        self.set_y_formatter(self.upright())

    def upright(self) -> NumericAxisFormatter:
        """What labels the upright axis.

        Not set by an ``on_mount`` of a subclass: Textual calls that of this class after it.
        """
        return Spaced(self)

    def _render_plot(self) -> None:
        """Draw nothing while there is nothing: an axis without marks would pass for a result."""
        if self._datasets:
            super()._render_plot()
            return
        for canvas in self.query(Canvas):
            if canvas.size:
                canvas.reset()

    def changed(self, key: object) -> bool:
        """Whether what is to be drawn, or the theme, differs from what is drawn."""
        if (key, self.app.theme) == self._drawn:
            return False
        self._drawn = (key, self.app.theme)
        return True

    def tint(self, role: str) -> str:
        """The present theme's colour for a role."""
        return tinted(self.app, role)


class MissPlot(QuietPlot):
    """Distance of each reading from its prediction, micrometres, over the reading's number."""

    def show(self, points: Sequence[Point], base: Collection[str]) -> None:
        """Draw the points; one marker for each platform nest, and one for all ``base`` nests."""
        if not self.changed((len(points), points[-1].number if points else 0)):
            return
        self.clear()
        self.border_subtitle = ""
        if not points:
            return
        top = max(point.miss_mm for point in points) * 1000.0
        self.set_xlimits(0, max(10, points[-1].number + 1))
        self.set_ylimits(0, max(1.0, top * 1.08))
        nests = sorted({point.nest for point in points} - set(base))
        signs = []
        for name, (marker, style) in zip(
            [*nests, "base"], [*SERIES[: len(nests)], BASE], strict=False
        ):
            mine = [p for p in points if (p.nest in base if name == "base" else p.nest == name)]
            x = np.array([float(point.number) for point in mine])
            y = np.array([point.miss_mm * 1000.0 for point in mine])
            x, y = thin(x, y, MOST // (len(nests) + 1))
            self.scatter(x, y, marker=marker, marker_style=self.tint(style))
            if mine:
                signs.append(f"{marker} {name}")
        self.border_subtitle = f"nest  {'   '.join(signs)}"


class ScatterPlot(QuietPlot):
    """Scatter of the SMR in the settling window against its limit, micrometres, the last ones."""

    def show(self, values_mm: Sequence[float], limit_mm: float, key: object) -> None:
        """Draw the curve and the limit."""
        if not self.changed(key):
            return
        self.clear()
        self.set_xticks([])
        if not values_mm:
            return
        x = np.arange(len(values_mm), dtype=float)
        y = np.array(values_mm) * 1000.0
        self.set_xlimits(0, max(20.0, x[-1]))
        self.set_ylimits(0, max(float(y.max()), limit_mm * 1000.0) * 1.1)
        self.plot(
            np.array([0.0, max(20.0, x[-1])]),
            np.full(2, limit_mm * 1000.0),
            line_style=self.tint("quiet"),
            hires_mode=HiResMode.BRAILLE,
        )
        self.plot(x, y, line_style=self.tint("primary"), hires_mode=HiResMode.BRAILLE)


class PairPlot(QuietPlot):
    """Two or three series over one axis, as markers."""

    def show(self, series: Mapping[str, tuple[Array, Array]], key: object) -> None:
        """Draw named series of x and y."""
        if not self.changed(key):
            return
        self.clear()
        drawn = {name: xy for name, xy in series.items() if len(xy[0])}
        if not drawn:
            return
        ends = [bound for x, _ in drawn.values() for bound in (np.min(x), np.max(x))]
        self.set_xlimits(*around(float(min(ends)), float(max(ends))))
        tops = [float(np.nanmax(y)) for _, y in drawn.values()]
        self.set_ylimits(0, max(1e-9, max(tops)) * 1.08)
        for (x, y), (marker, style) in zip(drawn.values(), SERIES, strict=False):
            thinned = thin(np.asarray(x, float), np.asarray(y, float), MOST)
            self.scatter(*thinned, marker=marker, marker_style=self.tint(style))
        self.border_subtitle = "   ".join(
            f"{marker} {name}" for name, (marker, _) in zip(drawn, SERIES, strict=False)
        )


class SeriesPlot(QuietPlot):
    """One quantity over days, with its uncertainty."""

    def show(
        self, name: str, unit: str, days: Array, values: Array, sigmas: Array, key: object
    ) -> None:
        """Draw values (N,) with sigmas (N,) over days (N,), 0 being the last; um where it is mm."""
        if not self.changed(key):
            return
        self.clear()
        scale, unit = (1e3, "µm") if unit == "mm" else (1.0, micro(unit))
        middle = float(values[-1]) if scale == 1e3 else 0.0
        y, sigma = scale * (values - middle), scale * sigmas
        low, high = float(np.min(y - sigma)), float(np.max(y + sigma))
        room = 0.1 * (high - low) or 1.0
        over, days = ago(days)
        self.set_ylimits(low - room, high + room)
        self.set_xlimits(*around(float(days[0]), float(days[-1])))
        self.errorbar(days, y, yerr=sigma, marker="o", marker_style=self.tint("accent"))
        against = " against the last" if middle else ""
        self.border_title = f"{name}, {unit}{against}, over {over}"


def ago(days: Array) -> tuple[str, Array]:
    """Times (N,) before now in the unit that suits the longest: its name, and the times in it."""
    span = float(np.ptp(days)) if len(days) else 0.0
    for name, per_day, least in (("days", 1.0, 2.0), ("hours", 24.0, 2.0 / 24.0)):
        if span >= least:
            return name, per_day * days
    return "minutes", 1440.0 * days


class TargetPlot(QuietPlot):
    """Named series of x and y as markers, and a line at what is wanted."""

    def show(
        self, series: Mapping[str, tuple[Array, Array]], target: float | None, key: object
    ) -> None:
        """Draw the line, and the series over it; nothing without a target."""
        if not self.changed(key):
            return
        self.clear()
        if target is None:
            return
        ends = [float(bound) for x, _ in series.values() for bound in x]
        low, high = 0.0, 1.1 * max(ends, default=10.0)
        tops = [float(value) for _, y in series.values() for value in y]
        self.set_xlimits(low, high)
        self.set_ylimits(0, 1.1 * max([target, *tops]))
        self.plot(
            np.array([low, high]), np.full(2, target), line_style=self.tint("quiet"),
            hires_mode=HiResMode.BRAILLE,
        )  # fmt: skip
        for (x, y), (marker, style) in zip(series.values(), SERIES, strict=False):
            if len(x):
                self.scatter(x, y, marker=marker, marker_style=self.tint(style))
        signs = "   ".join(
            f"{sign} {name}" for name, (sign, _) in zip(series, SERIES, strict=False)
        )
        self.border_subtitle = f"{signs}   ─ wanted"


class Decades(NumericAxisFormatter):
    """Labels an axis of logarithms with the numbers themselves."""

    def get_ticks_and_labels(
        self, min_: float, max_: float, max_ticks: int = 8
    ) -> tuple[list[float], list[str]]:
        """Whole decades, and 2 and 5 between them where there are few."""
        whole = range(math.floor(min_), math.ceil(max_) + 1)
        parts = (1.0, 2.0, 5.0) if max_ - min_ < 1.5 else (1.0,)
        values = [part * 10.0**decade for decade in whole for part in parts]
        shown = [value for value in values if min_ <= math.log10(value) <= max_]
        return [math.log10(value) for value in shown], [f"{value:g}" for value in shown]


class LogPairPlot(PairPlot):
    """The same over a logarithmic axis: a machine before and after differs by decades."""

    def upright(self) -> NumericAxisFormatter:
        """Labels at decades."""
        return Decades()

    def show(self, series: Mapping[str, tuple[Array, Array]], key: object) -> None:
        """Draw named series of x and y; zeros stand at the bottom."""
        known = {name: xy for name, xy in series.items() if len(xy[0])}
        least = min(
            (float(y[y > 0].min()) for _, y in known.values() if (y > 0).any()), default=1.0
        )
        lifted = {name: (x, np.log10(np.maximum(y, least))) for name, (x, y) in known.items()}
        super().show(lifted, key)
        if known:
            bottom = math.log10(least)
            top = max(float(y.max()) for _, y in lifted.values())
            self.set_ylimits(bottom - 0.08, max(top + 0.08, bottom + 0.5))


class BinPlot(QuietPlot):
    """What the residual asks for, bin by bin, over the variable on which it depends."""

    def show(self, structure: Mapping[str, Any]) -> None:
        """Draw bins (middle, value, sigma) with error bars, and zero."""
        bins = structure["bins"]
        if not self.changed(id(structure)):
            return
        self.clear()
        if not bins:
            return
        x = np.array([0.5 * (each["from"] + each["to"]) for each in bins])
        y = np.array([each["value"] for each in bins])
        sigma = np.array([each["sigma"] for each in bins])
        reach = float(np.max(np.abs(y) + sigma)) * 1.1
        self.set_ylimits(-reach, reach)
        self.set_xlimits(*around(float(x[0]), float(x[-1])))
        self.set_xticks(few_ticks(float(x[0]), float(x[-1])))
        self.plot(
            x[[0, -1]], np.zeros(2), line_style=self.tint("quiet"), hires_mode=HiResMode.BRAILLE
        )
        self.errorbar(x, y, yerr=sigma, marker="o", marker_style=self.tint("accent"))
        over = structure["channel"]
        if structure["period"]:
            over += f" mod {structure['period']:.3g}"
        unit = "µrad" if structure["unit"] == "urad" else "µm"
        shows = structure["shows_in"].removeprefix("extension of ")
        self.border_title = f"{shows}, {unit}, over {over}"


def around(low: float, high: float) -> tuple[float, float]:
    """Limits of an axis that show the marks at both ends: a mark on the limit itself is lost."""
    margin = 0.02 * (high - low) if high > low else 0.5
    return low - margin, high + margin


def few_ticks(low: float, high: float, most: int = 4) -> list[float]:
    """Round numbers from ``low`` to ``high``, at most ``most``: their labels must not touch."""
    span = high - low
    if not span > 0.0:
        return [low]
    decade = 10.0 ** math.floor(math.log10(span))
    steps = (decade * part for part in (0.2, 0.5, 1.0, 2.0, 5.0))
    step = next(s for s in steps if math.floor(high / s) - math.ceil(low / s) < most)
    first, last = math.ceil(low / step), math.floor(high / step)
    return [step * number for number in range(first, last + 1)]


def thin(x: Array, y: Array, most: int) -> tuple[Array, Array]:
    """Keep at most ``most`` points: of each group of neighbours the largest, never an outlier lost.

    ``x`` and ``y`` are (N,), in order.
    """
    if len(x) <= most:
        return x, y
    edges = np.linspace(0, len(x), most + 1).astype(int)
    kept = np.array([lo + int(np.argmax(np.abs(y[lo:hi]))) for lo, hi in zip(edges, edges[1:])])  # noqa: B905, RUF007
    return x[kept], y[kept]
