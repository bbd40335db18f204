"""No number of a paper stays unexplained, and the page is written by the command."""

from pathlib import Path

import pytest

from app.cli import run
from app.reproduce.feng import Feng, feng_rows
from app.reproduce.papers import paper
from app.reproduce.rows import BETTER, NOT_REACHABLE, REACHED, compare
from app.reproduce.zhang import Zhang
from calib.errors import BadInput


def test_reached_within_what_is_allowed() -> None:
    assert compare("T1", "a", 1.0, 1.01, "mm", within=0.02).verdict == REACHED
    assert compare("T1", "a", [1.0, 2.0], [1.01, 2.01], "mm", relative=0.02).verdict == REACHED


def test_a_smaller_error_is_better_only_where_it_is_an_error() -> None:
    assert compare("T1", "a", 1.0, 0.5, "mm", smaller_is_better=True).verdict == BETTER
    with pytest.raises(BadInput, match=r"T1, a: ours 0\.5 mm, theirs 1"):
        compare("T1", "a", 1.0, 0.5, "mm")


def test_a_number_out_of_reach_needs_a_reason() -> None:
    row = compare("T1", "a", 1.0, 3.0, "mm", because="raw data not printed")
    assert (row.verdict, row.because) == (NOT_REACHABLE, "raw data not printed")


def test_every_row_of_the_tripod_has_a_verdict_and_a_reason_where_it_must() -> None:
    rows = feng_rows(Feng())
    assert {row.verdict for row in rows} <= {REACHED, BETTER, NOT_REACHABLE}
    assert all(row.because for row in rows if row.verdict == NOT_REACHABLE)
    said = {row.what: row.ours for row in rows}
    assert said["full calibration: l_10, l_20, l_30"].endswith("411.902")


def test_the_papers_own_tables_are_whole() -> None:
    assert len(paper("zhang")["tables"]["errors"]) == 28
    assert all(len(paper("han")["table2"][k]) == 6 for k in paper("han")["table2"])
    study = Zhang()
    assert {e.name for e in study.errors} <= {p.name for p in study.machine.parameters}


@pytest.mark.long
def test_the_command_writes_a_page_with_its_figures(tmp_path: Path) -> None:
    assert run(["reproduce", "--paper", "feng", "--out", str(tmp_path)]) == 0
    page = (tmp_path / "reproduction.md").read_text(encoding="utf-8")
    assert "| Table 3 | zero calibration" in page
    for figure in ("feng-3", "feng-7"):
        assert f"(figures/reproduction/{figure}.png)" in page
        assert (tmp_path / "figures" / "reproduction" / f"{figure}.png").stat().st_size > 5000
    assert "missing" not in page.replace("missing from the model", "")
