"""Usual mistakes are found by the data themselves, in an import and in any analysis."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.files.runs import read_run
from app.jobs.importing import import_run
from calib.errors import BadInput
from calib.look import first_look
from calib.look.conventions import Misread
from calib.runs.record import Run


def _nests(run: Run, platform: float, base: float) -> Run:
    tables = {
        "platform_nests": {n: platform * at for n, at in run.header.platform_nests.items()},
        "base_nests": {n: base * at for n, at in run.header.base_nests.items()},
    }
    return replace(run, header=replace(run.header, **tables))


def _exchanged(run: Run, a: int, b: int) -> Run:
    q = run.q.copy()
    q[[a, b]] = q[[b, a]]
    return replace(run, q=q)


MISREAD: dict[str, tuple[Callable[[Run], Run], str]] = {
    "m": (lambda run: replace(run, position=run.position / 1e3), "x, y, z look like m, not mm"),
    "um": (lambda run: replace(run, position=run.position * 1e3), "x, y, z look like um, not mm"),
    "in": (lambda run: replace(run, position=run.position / 25.4), "look like inches"),
    "nests": (lambda run: _nests(run, 1e-3, 1e-3), "[nests] looks like m"),
    "platform": (lambda run: _nests(run, 1.0 / 25.4, 1.0), "[nests.platform] looks like inches"),
    "base": (lambda run: _nests(run, 1.0, 1e-3), "[nests.base] looks like m"),
    "mirrored": (
        lambda run: replace(run, position=run.position * np.array([[1.0], [-1.0], [1.0]])),
        "left-handed",
    ),
    "axes": (lambda run: replace(run, position=run.position[[1, 0, 2]]), "left-handed"),
    "exchanged": (lambda run: _exchanged(run, 0, 1), "q1 and q2"),
    "sign": (
        lambda run: replace(run, q=820.0 - run.q),
        "all of q have the wrong sign",
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("case", MISREAD)
def test_another_way_of_writing_is_named(bench, case: str) -> None:
    change, said = MISREAD[case]
    with pytest.raises(Misread) as wrong:
        first_look(bench.loaded.machine, [change(bench.run)])
    assert said in wrong.value.what


def test_a_clean_run_and_turned_axes_are_left_alone(bench) -> None:
    for run in (bench.run, replace(bench.run, position=bench.run.position[[1, 2, 0]])):
        assert first_look(bench.loaded.machine, [run]).remarks == ()


def test_an_import_is_refused_where_the_data_prove_the_map_wrong(bench, tmp_path) -> None:
    run = replace(bench.run, position=bench.run.position / 1e3)
    table, plan = bench.table(tmp_path / "a.csv", run), bench.plan(tmp_path / "map.toml")
    with pytest.raises(BadInput, match="look like m, not mm") as wrong:
        import_run(table, plan, tmp_path / "run", header=bench.header)
    assert "[[reading]] (unit" in wrong.value.remedy
    assert not (tmp_path / "run").exists()
    report = import_run(table, plan, tmp_path / "run", header=bench.header, as_it_stands=True)
    assert [one.name for one in report.record] == ["misread"]
    assert read_run(tmp_path / "run").run.readings == bench.run.readings


@pytest.mark.long
def test_rows_of_another_machine_are_said_to_be_that(bench, tmp_path) -> None:
    """Readings that no way of writing brings to their nests."""
    draws = np.random.default_rng(3).normal(0.0, 300.0, bench.run.position.shape)
    few = bench.run.measured & (np.cumsum(bench.run.measured) % 3 == 0)
    run = replace(bench.run, position=bench.run.position + draws, measured=few)
    table, plan = bench.table(tmp_path / "a.csv", run), bench.plan(tmp_path / "map.toml")
    report = import_run(table, plan, tmp_path / "run", header=bench.header)
    (said,) = (one for one in report.record if one.name == "no-fit")
    assert "rows of another machine" in said.remedy
    assert not said.settled


def test_what_the_first_look_knows_is_said_with_the_lines_of_the_file(bench, tmp_path) -> None:
    run = bench.run
    nest = list(run.nest)
    for k, name in enumerate(nest):
        nest[k] = {"p1": "p2", "p2": "p1"}.get(name, name)
    table = bench.table(tmp_path / "a.csv", replace(run, nest=tuple(nest)))
    table.write_text(table.read_text() + table.read_text().splitlines()[-1] + "\n")
    plan = bench.plan(tmp_path / "map.toml")
    report = import_run(table, plan, tmp_path / "run", header=bench.header)
    names = {one.name for one in report.record}
    assert "rows-twice" in names
    assert names & {"nests-exchanged", "nests-mirrored"}
    doubled = next(one for one in report.record if one.name == "rows-twice")
    assert doubled.lines == ((run.readings + 2, run.readings + 2),)
    assert doubled.run == str(table)
