"""A first map: what it takes for granted is marked, and completed it brings the run."""

from pathlib import Path

import numpy as np
import pytest

from app.cli import run as pkmcal
from app.files.runs import read_run
from app.jobs.guessing import guess_map
from app.jobs.importing import import_run
from calib.errors import BadInput
from tests.importing.conftest import same

HABITS = {
    "plain": (",", repr, "utf-8", ""),
    "sheet": (";", lambda value: repr(value).replace(".", ","), "utf-8-sig", "sep=;\n"),
    "remarks": ("\t", lambda value: f"{value:.9f}", "latin-1", "Prüfung von Station A\n\n# raw\n"),
}


@pytest.mark.parametrize("habit", HABITS)
def test_a_guessed_map_brings_the_run(bench, tmp_path: Path, habit: str) -> None:
    delimiter, cell, encoding, before = HABITS[habit]
    table = bench.table(tmp_path / "a.csv", cell=cell, delimiter=delimiter)
    table.write_bytes((before + table.read_text()).encode(encoding))
    guess = guess_map(table, tmp_path / "map.toml", machine="tripod")
    assert len(guess.preview) == 4
    assert [one for one in guess.missing if "[nests" not in one] == []
    text = (tmp_path / "map.toml").read_text()
    assert text.count("ASSUMED") >= len(guess.assumed)
    import_run(table, tmp_path / "map.toml", tmp_path / "run", header=bench.header)
    assert same(read_run(tmp_path / "run").run, bench.run, tolerance=1e-6)


def test_units_that_nobody_states_are_marked_as_assumed(bench, tmp_path: Path) -> None:
    table = bench.table(tmp_path / "a.csv")
    for unit in ("[mm]", "[s]"):
        table.write_text(table.read_text().replace(unit, ""))
    guess = guess_map(table, tmp_path / "map.toml", machine="tripod")
    assert any("x, y, z in mm, by the size" in one for one in guess.assumed)
    import_run(table, tmp_path / "map.toml", tmp_path / "run", header=bench.header)
    assert same(read_run(tmp_path / "run").run, bench.run)


def test_a_guess_writes_over_nothing_and_needs_a_table(bench, tmp_path: Path, capsys) -> None:
    table = bench.table(tmp_path / "a.csv")
    (tmp_path / "map.toml").write_text("mine")
    with pytest.raises(BadInput, match="such a file already"):
        guess_map(table, tmp_path / "map.toml")
    for text in ("", "only words\nand more words\n"):
        table.write_text(text)
        with pytest.raises(BadInput):
            guess_map(table, tmp_path / "new.toml")
    assert pkmcal(["import", str(table), "--guess", "--out", str(tmp_path / "run")]) == 2
    assert "ends in .toml" in capsys.readouterr().err


def points_of(bench, number, apart: str, quote: str = "") -> str:
    """Rows as SpatialAnalyzer has them: collection, group, target, x, y, z."""
    run, lines = bench.run, []
    for k in np.flatnonzero(run.measured):
        names = ("Köln", f"P{run.pose[k]}" if run.pose[k] else "REF", run.nest[k])
        cells = [*(f"{quote}{one}{quote}" for one in names), *map(number, run.position[:, k])]
        lines.append(apart.join(cells) + "\n")
    return "".join(lines)


def comma(value: float) -> str:
    return f"{value:.6f}".replace(".", ",")


POINTS = {
    "comma": (comma, " ", "", "// Units: mm\n", ""),
    "quoted": (lambda value: f"{value:.6f}", ", ", '"', "", "Total points: 38\nRMS 0.01\n"),
    "tabs": (comma, "\t", "", "// a\n\n// b\n", "\n\nAnzahl der Punkte: 38\n"),
}


@pytest.mark.parametrize("habit", POINTS)
def test_points_with_habits_of_their_own_are_guessed_as_the_map_that_ships(
    bench, tmp_path: Path, habit: str
) -> None:
    number, apart, quote, before, behind = POINTS[habit]
    text = before + points_of(bench, number, apart, quote) + behind
    (tmp_path / "points.txt").write_bytes(text.encode("latin-1"))
    run = bench.run
    told = {f"P{run.pose[k]}": run.q[:, k] for k in range(run.measured.size) if run.pose[k]}
    rows = [f"{pose},{','.join(map(repr, q.tolist()))}" for pose, q in told.items()]
    (tmp_path / "told.csv").write_text("\n".join(["pose,q1[mm],q2[mm],q3[mm]", *rows]) + "\n")
    guess = guess_map(tmp_path / "points.txt", tmp_path / "map.toml", machine="tripod")
    assert any("spatial-analyzer" in one for one in guess.assumed)
    assert any("end before" in one for one in guess.assumed) == bool(behind)
    import_run(
        tmp_path / "points.txt", tmp_path / "map.toml", tmp_path / "run", header=bench.header,
        commands=tmp_path / "told.csv",
    )  # fmt: skip
    assert same(read_run(tmp_path / "run").run, run, tolerance=1e-6)
