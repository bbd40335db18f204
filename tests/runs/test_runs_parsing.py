"""What a run may look like, and how every fault in one is named."""

from pathlib import Path

import numpy as np
import pytest

from calib.errors import BadInput
from calib.runs import format_run, holdout_folds, parse_run

RUNS = Path(__file__).parents[1] / "data" / "runs"

TOML = """format = "pkm-run/1"
machine = "two"   # a comment
title = "t"
[tracker]
model = "AT901-LR"
[nests.platform]
"3" = [0.0, 100.0, 0.0]
[nests.base]
b1 = [260.0, 0.0, -30.0]
[controller.parameters]
"leg1.L0" = 230.5
"""
HEADER = "time_s,pose,nest,q1,q2,x,y,z,sx,sy,sz,structure_temp_C"
ROWS = (
    "0.0,home,,230.0,230.0,,,,,,,20.0",
    "6.0,,b1,230.0,230.0,1.0,2.0,3.0,0.005,0.005,0.005,20.1",
    "9.0,1,3,231.0,229.0,4.0,5.0,6.0,0.005,0.005,0.005,nan",
    "9.0,1,3,231.0,229.0,4.0,5.0,6.0,0.005,0.005,0.005,20.3",
)
CSV = "\n".join([HEADER, *ROWS]) + "\n"


def read(points=CSV, toml=TOML):
    return parse_run(toml, points, actuators=2, parameters=["leg1.L0", "leg2.L0"])


def changed(row, column, value):
    rows = [line.split(",") for line in ROWS]
    rows[row][HEADER.split(",").index(column)] = value
    return "\n".join([HEADER, *map(",".join, rows)]) + "\n"


def test_runs_arrays_hold_what_the_file_says():
    run = read()
    assert run.readings == 3
    assert run.measured.tolist() == [False, True, True, True]
    assert run.line.tolist() == [2, 3, 4, 5]
    assert run.q[:, 2].tolist() == [231.0, 229.0]
    assert np.isnan(run.channels["structure_temp_C"][2])
    assert run.header.controller_parameters == {"leg1.L0": 230.5}
    np.testing.assert_allclose(run.covariance[:, :, 1], np.eye(3) * 0.005**2)


@pytest.mark.parametrize("name", sorted(p.name for p in RUNS.iterdir()))
def test_runs_written_and_read_again_are_equal_bit_for_bit(name):
    texts = [(RUNS / name / file).read_text() for file in ("run.toml", "points.csv")]
    run = parse_run(*texts, actuators=6)
    again = parse_run(*format_run(run), actuators=6)
    for field in ("time_s", "q", "measured", "position", "covariance"):
        np.testing.assert_array_equal(getattr(run, field), getattr(again, field))
    assert (run.pose, run.nest) == (again.pose, again.nest)
    assert list(run.channels) == list(again.channels)
    assert format_run(run) == format_run(again)


def test_runs_with_covariances_are_written_with_them():
    rows = [line + ",1e-6,0,-2e-6" if line[0] != "0" else line + ",,," for line in ROWS]
    text = "\n".join([HEADER + ",sxy,sxz,syz", *rows]) + "\n"
    run = read(text)
    again = parse_run(*format_run(run), actuators=2)
    assert run.covariance[0, 1, 1] == 1e-6
    np.testing.assert_array_equal(run.covariance, again.covariance)


@pytest.mark.parametrize(
    "text",
    [
        CSV.replace("\n", "\r\n"),
        "\ufeff" + CSV,
        CSV.rstrip("\n"),
        CSV + "\n\n",
        CSV.replace("home", '"home, sweet"').replace("time_s,", '"time_s",'),
        CSV.replace(",", " , "),
    ],
    ids=["CRLF", "BOM", "no last newline", "blank lines", "quoted", "spaces"],
)
def test_runs_of_other_programs_are_read(text):
    assert read(text).readings == 3


def test_runs_column_of_remarks_is_left_aside_and_said():
    text = "\n".join([HEADER + ",remark", *(line + ",ok then" for line in ROWS)]) + "\n"
    run = read(text)
    assert "remark" not in run.channels
    assert run.left_aside == {"remark": "line 2 holds 'ok then'"}


def test_runs_delay_and_cycle_are_channels_and_unknown_channels_are_welcome():
    text = "\n".join([HEADER + ",delay_s,cycle,wind", *(row + ",1.5,2,7" for row in ROWS)]) + "\n"
    assert {"delay_s", "cycle", "wind"} <= read(text).channels.keys()


@pytest.mark.parametrize(
    ("text", "line", "column", "said"),
    [
        ("", 1, "", "empty"),
        (HEADER + "\n", 2, "", "no rows"),
        (CSV[:-30], 5, "", "truncated"),
        (CSV[:-2], 5, "structure_temp_C", "truncated"),
        (changed(1, "x", "nan"), 3, "x", "'nan'"),
        (changed(2, "y", "abc"), 4, "y", "'abc'"),
        (changed(2, "z", ""), 4, "z", "empty"),
        (changed(1, "q1", "inf"), 3, "q1", "'inf'"),
        (changed(1, "q1", "1_0"), 3, "q1", "'1_0'"),
        (changed(1, "sx", "0"), 3, "sx", "larger than zero"),
        (changed(1, "sz", "-0.005"), 3, "sz", "larger than zero"),
        (changed(3, "time_s", "8.5"), 5, "time_s", "goes back"),
        (changed(1, "nest", "7"), 3, "nest", "unknown nest '7'"),
        (changed(0, "x", "1.0"), 2, "x", "a move only"),
        (changed(2, "structure_temp_C", "warm"), 4, "structure_temp_C", "'warm'"),
        (CSV.replace(ROWS[2], HEADER), 4, "", "header is repeated"),
        (CSV.replace(",sz", ",SZ"), 1, "sz", "missing (found 'SZ')"),
        (CSV.replace("structure_temp_C", "x"), 1, "x", "appears twice"),
        (CSV.replace("q2", "other"), 1, "q2", "wrong number of actuators"),
        (CSV.replace("structure_temp_C", "q3"), 1, "q3", "wrong number of actuators"),
        (CSV.replace(",", "|"), 1, "", "wrong number of actuators"),
        (CSV.replace(ROWS[1], ROWS[1] + ",1"), 3, "", "13 fields"),
        (CSV.replace("home", '"home'), 6, "", "comma-separated"),
    ],
)  # fmt: skip
def test_runs_fault_in_the_points_is_named_with_its_place(text, line, column, said):
    with pytest.raises(BadInput) as caught:
        read(text)
    assert caught.value.place.startswith(f"points.csv, line {line}")
    assert column in caught.value.place
    assert said in str(caught.value)


def test_runs_covariance_that_is_none_is_refused():
    rows = [line + ",3e-5" for line in ROWS]
    with pytest.raises(BadInput, match=r"line 3, column sxy.*positive definite"):
        read("\n".join([HEADER + ",sxy", *rows]) + "\n")


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("pkm-run/1", "pkm-run/9", 1, "pkm-run/9"),
        ('machine = "two"', "machine = 7", 2, "machine"),
        ('machine = "two"', "", 0, "machine is missing"),
        ("[0.0, 100.0, 0.0]", "[0.0, 100.0]", 7, "3 finite numbers"),
        ("[0.0, 100.0, 0.0]", "[0.0, nan, 0.0]", 7, "3 finite numbers"),
        ("b1 =", '"3" =', 7, "both on the platform and on the base"),
        ("[tracker]", "[tracker", 4, "not valid TOML"),
        ("leg1.L0", "leg9.L0", 11, "leg9.L0"),
        ("230.5", '"long"', 11, "finite number"),
        ('"3" = [0.0, 100.0, 0.0]', "", 0, "no nest"),
    ],
)
def test_runs_fault_in_the_toml_is_named_with_its_line(old, new, line, said):
    with pytest.raises(BadInput) as caught:
        read(toml=TOML.replace(old, new))
    assert "run.toml" in caught.value.place
    assert not line or f"line {line}" in caught.value.place
    assert said in str(caught.value)


def test_runs_every_truncation_is_an_error_or_a_whole_run():
    """Cut after any character: never a crash, never a reading with a cut number in it."""
    for end in range(len(CSV)):
        try:
            run = read(CSV[:end])
        except BadInput:
            continue
        assert CSV[:end].rstrip("\n").endswith(ROWS[len(run.nest) - 1])


def test_runs_folds_hold_whole_poses_and_do_not_change():
    run = parse_run(*[(RUNS / "mystery" / f).read_text() for f in ("run.toml", "points.csv")],
                    actuators=6)  # fmt: skip
    fold = holdout_folds(run)
    by_label: dict[str, set[int]] = {}
    for label, nest, number in zip(run.pose, run.nest, fold, strict=True):
        if nest in run.header.platform_nests:
            by_label.setdefault(label, set()).add(int(number))
        else:
            assert number == -1
    assert all(len(folds) == 1 for folds in by_label.values())
    counts = np.bincount([min(folds) for folds in by_label.values()])
    assert counts.tolist() == [16] * 5
    np.testing.assert_array_equal(fold, holdout_folds(run))


def test_runs_folds_of_a_run_are_the_same_in_every_version():
    """A hold-out is compared with last year's: pinned by pose, in the order of the file.

    The last pose has no label: it is known by its q.
    """
    labels = [f"p{number}" for number in range(11)] + [""]
    rows = [
        f"{number}.0,{label},3,{number}.0,230.0,1.0,2.0,3.0,0.005,0.005,0.005,20.0"
        for label in labels
        for number in [labels.index(label)] * 2
    ]
    fold = holdout_folds(read("\n".join([HEADER, *rows, ""])))
    assert fold[::2].tolist() == fold[1::2].tolist() == [0, 0, 0, 1, 3, 2, 1, 4, 3, 4, 1, 2]
