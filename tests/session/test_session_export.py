"""From rows to points.csv: order, moves without a reading, and a reader that agrees."""

from importlib import resources
from pathlib import Path

import numpy as np

from app.files.machines import load_machine
from app.files.site import parse_site
from app.session.export import DIGITS, export_run, run_of
from app.session.journal import Journal
from app.session.plan import Plan
from app.session.rows import Row
from calib.runs import Header, format_points, format_run, parse_header, parse_run

HEADER = Header("hexapod", platform_nests={"3": np.zeros(3), "4": np.ones(3)})

Q0, Q1, Q2 = (230.0,) * 6, (231.0,) * 6, (232.0,) * 6


def row(kind: str, time_s: float, pose: str, q: tuple[float, ...], nest: str = "") -> Row:
    reading = kind == "reading"
    return Row(
        seq=0, step="", kind=kind, status="good", why="", time_s=time_s, pose=pose, nest=nest, q=q,
        xyz=(1.0, 2.0, 3.0) if reading else None,
        covariance=(4e-6, 9e-6, 16e-6, 1e-7, 0.0, 0.0) if reading else None,
        delay_s=2.0 if reading else None, cycle=None,
        channels={"air_temp_C": 20.5} if reading else {}, raw={},
    )  # fmt: skip


def lines(rows: list[Row]) -> list[list[str]]:
    return [line.split(",") for line in format_points(run_of(rows, HEADER, 6), DIGITS).splitlines()]


def test_a_move_without_a_reading_stays_and_one_that_was_read_goes() -> None:
    table = lines(
        [
            row("move", 0.0, "a", Q0),
            row("reading", 1.0, "a", Q0, "3"),
            row("move", 2.0, "b", Q1),
            row("move", 3.0, "c", Q2),
            row("reading", 4.0, "c", Q2, "3"),
        ]
    )
    assert [(cells[1], cells[2]) for cells in table[1:]] == [("a", "3"), ("b", ""), ("c", "3")]
    assert table[2][9:19] == [""] * 10


def test_times_never_decrease_and_sigmas_come_from_the_covariance() -> None:
    table = lines([row("reading", 5.0, "a", Q0, "3"), row("reading", 4.9, "a", Q0, "4")])
    header = table[0]
    assert [cells[0] for cells in table[1:]] == ["5.000", "5.000"]
    sigma = [float(table[1][header.index(name)]) for name in ("sx", "sy", "sz")]
    assert sigma == [0.002, 0.003, 0.004]
    assert float(table[1][header.index("sxy")]) == 1e-7
    assert table[1][header.index("air_temp_C")] == "20.5"


def test_what_is_exported_is_read_back() -> None:
    rows = [row("move", 0.0, "a", Q0), row("move", 1.0, "b", Q1), row("reading", 2.0, "b", Q1, "3")]
    exported = run_of(rows, HEADER, 6)
    again = parse_run(*format_run(exported, DIGITS), actuators=6)
    assert again.pose == ("a", "b") == exported.pose
    np.testing.assert_array_equal(again.line, exported.line)  # a fault names the same line
    np.testing.assert_allclose(again.covariance, exported.covariance, rtol=1e-6)
    np.testing.assert_array_equal(again.channels["delay_s"], [np.nan, 2.0])


def test_a_session_without_a_row_exports_a_header_alone() -> None:
    assert lines([]) == [
        ["time_s", "pose", "nest", "q1", "q2", "q3", "q4", "q5", "q6", "x", "y", "z",
         "sx", "sy", "sz", "delay_s"]
    ]  # fmt: skip


def test_a_machine_of_the_labs_own_goes_with_the_run(tmp_path: Path) -> None:
    lab, station = tmp_path / "lab", tmp_path / "lab" / "stations"
    station.mkdir(parents=True)
    own = resources.files("calib.machines") / "hexapod.toml"
    text = own.read_text(encoding="utf-8").replace('name = "hexapod"', 'name = "mine"')
    (lab / "mine.toml").write_text(text, encoding="utf-8")
    site = parse_site(SITE, "site.toml", station)
    plan = Plan("measure", "t", site.machine_name, {}, ())
    journal = Journal(tmp_path / "journal.sqlite")
    try:
        folder = export_run(site, plan, journal, tmp_path / "elsewhere" / "run")
    finally:
        journal.close()
    header = parse_header((folder / "run.toml").read_text(encoding="utf-8"), source="run.toml")
    assert load_machine(header.machine, folder).name == "mine"


SITE = """
format = "pkm-site/1"
machine = "../mine.toml"
[controller]
kind = "canopen"
channel = "can0"
[tracker]
kind = "emscon"
address = "10.0.0.1"
frame = [0, 0, 0, 0, 0, 0]
[nests.platform]
3 = [0.0, 100.0, 0.0]
[nests.base]
b1 = [260.0, 0.0, -30.0]
b2 = [0.0, 260.0, -30.0]
b3 = [-260.0, 0.0, -30.0]
"""
