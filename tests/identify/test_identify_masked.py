"""Readings that the operator masks are left out, named, and never deleted."""

from pathlib import Path

import pytest

from app.analysis import masked_rows, read_rows
from app.jobs.fitting import fit
from calib.errors import BadInput

RUNS = Path(__file__).parents[1] / "data" / "runs"
ONE, OTHER = str(RUNS / "no-effect"), str(RUNS / "backlash-leg-3")


def test_a_masked_line_is_out_of_the_fit_and_in_the_answer() -> None:
    before = (Path(ONE) / "points.csv").read_bytes()
    whole, found = fit(ONE), fit(ONE, mask=[20, "33"])
    assert found.readings == whole.readings - 2
    masked = [one.line for one in found.bad_readings if one.why == "masked by the operator"]
    assert masked == [20, 33]
    assert (Path(ONE) / "points.csv").read_bytes() == before


def test_of_several_runs_the_run_is_named() -> None:
    rows = read_rows((ONE, OTHER))
    (row,) = masked_rows(rows, [f"{OTHER}:20"])
    assert rows.place(row) == f"{Path(OTHER) / 'points.csv'}, line 20"


@pytest.mark.parametrize("line", ["1", "99999", "x", f"{OTHER}:20"])
def test_a_line_without_a_reading_is_refused(line: str) -> None:
    with pytest.raises(BadInput):
        masked_rows(read_rows((ONE,)), [line])
