"""points.csv as sheets spell it: the same numbers, or a refusal with line and column."""

import csv
import io
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.errors import BadInput
from calib.runs import parse_run
from calib.runs.record import Run
from calib.runs.spelling import spelled

FOLDER = Path(__file__).parents[1] / "data" / "runs" / "no-effect"
HEADER = (FOLDER / "run.toml").read_text(encoding="utf-8")
PLAIN = "\n".join((FOLDER / "points.csv").read_text(encoding="utf-8").splitlines()[:40]) + "\n"
Q = tuple(f"q{number}" for number in range(1, 7))


def read(text: str) -> Run:
    return parse_run(HEADER, text, actuators=6, units=["mm"] * 6)


def written(rows: list[list[str]], delimiter: str = ",") -> str:
    text = io.StringIO()
    csv.writer(text, delimiter=delimiter, lineterminator="\n").writerows(rows)
    return text.getvalue()


def cells() -> list[list[str]]:
    return [line.split(",") for line in PLAIN.splitlines()]


def with_commas(rows: list[list[str]]) -> list[list[str]]:
    return [rows[0], *[[cell.replace(".", ",") for cell in row] for row in rows[1:]]]


def scaled(rows: list[list[str]], names: tuple[str, ...], unit: str, factor: float, zero=0.0):
    """Columns in another unit, stated in the header."""
    head = list(rows[0])
    found = [list(row) for row in rows]
    for name in names:
        at = head.index(name)
        found[0][at] = f"{name}[{unit}]"
        for row in found[1:]:
            row[at] = repr(float(row[at]) / factor + zero) if row[at] else ""
    return found


def same(text: str) -> bool:
    one, other = read(text), read(PLAIN)
    return (
        np.allclose(one.q, other.q, rtol=1e-12)
        and np.allclose(one.position, other.position, rtol=1e-12, equal_nan=True)
        and np.allclose(one.covariance, other.covariance, rtol=1e-12, equal_nan=True)
        and np.allclose(one.time_s, other.time_s)
        and one.nest == other.nest
        and all(
            np.allclose(values, one.channels[name], equal_nan=True)
            for name, values in other.channels.items()
        )
    )


def test_the_plain_spelling_is_handed_on_untouched() -> None:
    assert spelled(PLAIN, "points.csv") == PLAIN


SPELLINGS = {
    "semicolons": written(cells(), ";"),
    "tabs": written(cells(), "\t"),
    "decimal commas": written(with_commas(cells()), ";"),
    "a sheet": "\ufeffsep=;\n" + written([[*row, "", ""] for row in with_commas(cells())], ";"),
    "a sheet's line ends": written(with_commas(cells()), ";").replace("\n", "\r\n"),
    "quoted": "\n".join(",".join(f'"{cell}"' for cell in row) for row in cells()) + "\n",
    "empty columns": written([[*row, "", ""] for row in cells()]),
    "inches": written(scaled(cells(), ("x", "y", "z", "sx", "sy", "sz"), "in", 25.4)),
    "metres": written(scaled(cells(), (*Q, "x"), "m", 1000.0)),
    "sigmas in um": written(scaled(cells(), ("sx", "sy", "sz"), "um", 1e-3)),
    "kelvin": written(scaled(cells(), ("structure_temp_C",), "K", 1.0, 273.15)),
    "fahrenheit": written(scaled(cells(), ("air_temp_C",), "degF", 5.0 / 9.0, 32.0)),
    "minutes": written(scaled(cells(), ("time_s",), "min", 60.0)),
    "units below": written(
        [cells()[0], ["s", "", "", *["mm"] * 12, "degC", "degC", "kg"], *cells()[1:]]
    ),
}


@pytest.mark.parametrize("how", SPELLINGS)
def test_it_is_the_same_run(how: str) -> None:
    assert same(SPELLINGS[how])


def test_lines_are_those_of_the_file() -> None:
    text = "sep=;\n\n" + written(with_commas(cells()), ";").replace("\n6,00;", "\n\n6,00;", 1)
    plain = read(PLAIN).line
    assert read(text).line.tolist() == [plain[0] + 2, *(plain[1:] + 3)]


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (",x,", ",x[furlong],", 'line 1, column x: unknown unit "furlong"'),
        (",x,", ",x[deg],", 'line 1, column x: "deg" is no unit of what is measured'),
        (",q2,", ",q2[deg],", 'line 1, column q2: "deg" is no unit'),
        (",structure_temp_C,", ",structure_temp_C[mm],", "column structure_temp_C"),
        ("-182.181634", "-1.182,181634", "line 3"),
        ("-182.181634", '"1,182.181634"', "line 3, column x"),
    ],
)
def test_what_could_be_read_in_two_ways_is_refused(before: str, after: str, said: str) -> None:
    with pytest.raises(BadInput) as wrong:
        read(PLAIN.replace(before, after, 1))
    assert said in str(wrong.value)


def test_decimals_are_written_in_one_way() -> None:
    text = written(with_commas(cells()), ";").replace("-182,181634", "-182.181634", 1)
    with pytest.raises(BadInput, match=r"column x: found '-182.181634', where other"):
        read(text)
    with pytest.raises(BadInput, match=r"line 3, column x: found '-1.182,181634'"):
        read(text.replace("-182.181634", "-1.182,181634"))


@given(
    st.datetimes(datetime(1900, 3, 1), datetime(2199, 1, 1)),
    st.datetimes(datetime(1900, 3, 1), datetime(2199, 1, 1)),
)
def test_iso_times_are_apart_as_the_calendar_has_it(one: datetime, other: datetime) -> None:
    first, then = sorted([one, other])
    text = f"time,a\n{first.isoformat()},1\n{then.isoformat(sep=' ')}Z,2\n".replace("Z", "")
    seconds = spelled(text, "points.csv").splitlines()[2].split(",")[0]
    assert float(seconds) == pytest.approx((then - first).total_seconds(), abs=1e-3)


@pytest.mark.parametrize(
    ("times", "apart"),
    [
        (("2024-05-31T23:59:59+02:00", "2024-05-31T22:00:01Z"), 2.0),
        (("20240531T235959,5", "2024-06-01 00:00:00.25"), 0.75),
        (("2024-02-28T12:00", "2024-03-01T12:00"), 2 * 86400.0),
    ],
)
def test_zones_and_short_forms(times: tuple[str, str], apart: float) -> None:
    text = f'time,a\n"{times[0]}",1\n"{times[1]}",2\n'
    assert spelled(text, "points.csv").splitlines()[2] == f"{apart!r},2"


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("yesterday", "line 3, column time: found 'yesterday'"),
        ("2024-02-30T12:00:00", "found '2024-02-30T12:00:00'"),
        ("2024-03-01T12:00:00Z", "some times state a zone"),
        ("", "found ''"),
    ],
)
def test_what_is_no_moment_is_refused(cell: str, said: str) -> None:
    with pytest.raises(BadInput, match=said):
        spelled(f"time,a\n2024-02-28T12:00:00,1\n{cell},2\n", "points.csv")
