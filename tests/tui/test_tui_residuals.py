"""Reading by reading: what is left, a mask by hand that the next fit heeds, the way back."""

import csv
import io
import math
from pathlib import Path

import numpy as np
import pytest
import tui_stream as stream
from textual.widgets import DataTable

from app.files.residuals import residuals_text
from app.show.vector_map import vector_map
from app.tui.analysis import identify
from app.tui.program import Workbench
from app.tui.reading_lines import by_nest, lines_of_fit
from app.tui.residuals import ResidualsFace, VectorPanel
from calib.errors import BadInput
from calib.identify.readings import MASKED

RUN = Path(__file__).parents[1] / "data" / "runs" / "mystery"


def test_a_vector_map_shows_where_errors_point_and_how_long_they_are() -> None:
    across, up = np.meshgrid(np.linspace(-90.0, 90.0, 6), np.linspace(-40.0, 40.0, 3))
    places = np.array([across.ravel(), up.ravel()])
    alike = np.tile([[5.0], [0.0]], places.shape[1])
    drawing = vector_map(places, alike, 72, 12)
    assert drawing.ten_signs == pytest.approx(5.0 * 10 / 6)  # six signs long
    rows = [line for line in drawing.lines if line.strip("\u2800")]
    assert len(rows) == 3  # to the right, and nowhere else
    assert all(len(line) == 72 for line in drawing.lines)
    noise = np.random.default_rng(1).normal(0.0, 5.0, (2, 4000))
    many = np.random.default_rng(2).uniform(-90.0, 90.0, (2, 4000))
    assert (
        vector_map(many, noise, 72, 12).ten_signs
        < 0.3 * vector_map(places, alike, 72, 12).ten_signs
    )  # what points anywhere averages away
    assert vector_map(np.zeros((2, 0)), np.zeros((2, 0)), 10, 2).lines == ("", "")


@pytest.mark.long
def test_readings_are_those_of_the_table_for_other_programs() -> None:
    fit = identify((str(RUN),), (), ("118",)).fit
    lines = lines_of_fit(fit)
    why = {one.row: one.why for one in fit.bad}
    table = list(csv.DictReader(io.StringIO(residuals_text(fit.model, fit.linear, why))))
    assert len(lines) == len(table)
    for one, row in zip(lines, table, strict=True):
        assert (one.name, one.pose, one.nest) == (row["line"], row["pose"], row["nest"])
        wanted = [float(row[f"base_d{axis}_um"]) for axis in "xyz"]
        assert one.off_um == pytest.approx(wanted, abs=1e-3)
        assert one.sigmas == pytest.approx(float(row["sigmas"]), rel=1e-3)
        assert one.left_out == row["left_out"]
    assert {one.left_out for one in lines if one.line == 118} == {MASKED}
    nests = by_nest(lines)
    used = [one for one in lines if not one.left_out]
    assert [one.nest for one in nests][-1] == "all"
    assert sum(one.count for one in nests[:-1]) == nests[-1].count == len(used)
    rms = math.sqrt(sum(one.distance_um**2 for one in used) / len(used))
    assert nests[-1].distance_um == pytest.approx(rms)


@pytest.mark.long
async def test_a_masked_reading_is_left_out_of_the_next_fit_and_comes_back(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    study = bench.desk.study
    async with bench.run_test(size=(160, 48)) as pilot:
        study.choose((str(RUN),))
        await study.identify()
        assert study.answer is not None
        before = study.answer.report["readings"]
        await pilot.press("3", "e")
        await pilot.pause(0.3)
        assert isinstance(bench.screen, ResidualsFace)
        assert "10 signs long" in str(bench.screen.query_one(VectorPanel).border_subtitle)
        table = bench.screen.query_one(DataTable)
        worst = max(lines_of_fit(study.answer.fit), key=lambda one: one.sigmas)
        assert str(table.get_row_at(0)[0]).strip() == worst.name
        await pilot.press("m")
        await pilot.pause(0.4)
        assert study.masked == (worst.name,)
        assert "masked" in str(table.get_row_at(0)[-1])
        await study.identify()
        assert study.answer.report["readings"] == before - 1
        assert study.answer.report["bad_readings"][0]["why"] == MASKED
        await pilot.press("m")
        assert study.masked == ()
        await pilot.press("escape")
        await pilot.pause(0.2)
        assert bench.current_mode == "fit"
        study.choose(("elsewhere",))
        assert study.masked == ()


async def test_the_staircase_is_drawn_into_a_file(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    study = bench.desk.study
    study.answer = stream.fitted()
    with pytest.raises(BadInput, match="no staircase"):
        await study.save(tmp_path / "way.svg")
    study.search = stream.searched()
    await study.save(tmp_path / "way.svg")
    text = (tmp_path / "way.svg").read_text(encoding="utf-8")
    assert text.rstrip().endswith("</svg>")
    with pytest.raises(BadInput, match="nothing is fitted"):
        await Workbench(root=tmp_path).desk.study.save(tmp_path / "model.toml")
