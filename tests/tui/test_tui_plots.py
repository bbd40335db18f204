"""What is left out of a plot, and what never is."""

import re

import numpy as np
import pytest
from textual.app import App, ComposeResult
from textual_hires_canvas.canvas import Canvas

from app.show.spans import duration
from app.tui.theme import SERIES
from app.tui.widgets.plots import LogPairPlot, PairPlot, QuietPlot, ago, few_ticks, thin


def test_thinning_keeps_the_outlier() -> None:
    generator = np.random.default_rng(4)
    x = np.arange(5000.0)
    y = generator.normal(size=5000)
    y[1234] = -40.0
    kept_x, kept_y = thin(x, y, 400)
    assert len(kept_x) == 400
    assert 1234.0 in kept_x
    assert kept_y.min() == -40.0
    assert np.all(np.diff(kept_x) > 0)


def test_few_points_stay_as_they_are() -> None:
    x = np.arange(10.0)
    assert thin(x, x, 400)[0] is x


@pytest.mark.parametrize("size", [1e-6, 0.04, 3.7, 850.0])
def test_ticks_are_few_and_inside(size: float) -> None:
    ticks = few_ticks(-0.3 * size, size)
    assert 1 <= len(ticks) <= 4
    assert -0.3 * size <= ticks[0] <= ticks[-1] <= size


class Marks(App[None]):
    """One plot, as large as the screen."""

    def compose(self) -> ComposeResult:
        yield PairPlot("errors", id="plot")


@pytest.mark.parametrize("count", [1, 2, 27])
async def test_every_point_of_a_series_has_its_mark(count: int) -> None:
    marker = SERIES[0][0]
    async with Marks().run_test(size=(120, 30)) as pilot:
        plot = pilot.app.query_one(PairPlot)
        x = np.arange(float(count))
        plot.show({"all": (x, 5.0 + x % 3)}, count)
        await pilot.pause(0.2)
        canvas = plot.query_one("#plot", Canvas)
        lines = [canvas.render_line(row) for row in range(canvas.size.height)]
        text = "".join(segment.text for line in lines for segment in line)
        assert text.count(marker) == count


class Logarithmic(App[None]):
    """One plot over a logarithmic axis."""

    def compose(self) -> ComposeResult:
        yield LogPairPlot("errors", id="plot")


def drawn(plot: QuietPlot) -> str:
    """Everything that a plot shows, labels and marks."""
    return "\n".join(
        "".join(segment.text for segment in canvas.render_line(row))
        for canvas in plot.query(Canvas)
        for row in range(canvas.size.height)
    )


async def test_a_logarithmic_axis_is_labelled_with_the_numbers_themselves() -> None:
    async with Logarithmic().run_test(size=(120, 30)) as pilot:
        plot = pilot.app.query_one(LogPairPlot)
        plot.show({"all": (np.arange(3.0), np.array([3.0, 40.0, 700.0]))}, 1)
        await pilot.pause(0.2)
        labels = re.findall(r"^ *([0-9.]+) *$", drawn(plot), re.MULTILINE)
        assert {"10", "100"} <= set(labels)


async def test_a_plot_of_nothing_shows_nothing() -> None:
    async with Marks().run_test(size=(120, 30)) as pilot:
        plot = pilot.app.query_one(PairPlot)
        for count, shown in ((0, False), (3, True), (0, False)):
            plot.show({"all": (np.arange(float(count)), np.ones(count))}, (count, shown))
            await pilot.pause(0.2)
            assert bool(drawn(plot).strip()) is shown


@pytest.mark.parametrize(("span", "unit", "times"), [(90.0, "days", 1), (1.0, "hours", 24)])
def test_times_are_in_the_unit_that_suits_them(span: float, unit: str, times: float) -> None:
    days = np.array([-span, 0.0])
    assert ago(days)[0] == unit
    assert np.allclose(ago(days)[1], times * days)
    assert ago(days / 1e3)[0] == ("hours" if span > 84 else "minutes")


def test_time_spans_in_words() -> None:
    assert [duration(s) for s in (45.0, 600.0, 7500.0)] == ["45 s", "10 min", "2 h 05"]
