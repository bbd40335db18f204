"""A first map: what it takes for granted is marked, and completed it brings the run."""

from pathlib import Path

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
