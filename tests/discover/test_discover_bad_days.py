"""Runs as they come: channels missing, wrong holes, one nest, few poses; nothing lost silently."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from app.cli import run as pkmcal

pytestmark = pytest.mark.long

RUNS = Path(__file__).parents[1] / "data" / "runs"


@pytest.fixture
def changed(tmp_path):
    """A copy of an example run with its rows (dicts of text) changed by a function."""

    def make(name, change):
        folder = tmp_path / "run"
        folder.mkdir()
        (folder / "run.toml").write_text((RUNS / name / "run.toml").read_text())
        rows = list(csv.DictReader(io.StringIO((RUNS / name / "points.csv").read_text())))
        rows = change(rows)
        with (folder / "points.csv").open("w", newline="") as target:
            writer = csv.DictWriter(target, rows[0].keys(), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        return str(folder)

    return make


def answer(capsys, verb, run):
    assert pkmcal([verb, run, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def without(*columns):
    return lambda rows: [{k: v for k, v in row.items() if k not in columns} for row in rows]


def having(**values):
    return lambda rows: [row | values for row in rows]


def only(keep):
    return lambda rows: [row for row in rows if keep(row)]


def read_anew(value, noise):
    """A point read once more: never the same to the last digit."""
    return f"{float(value) + noise.normal(0.0, 0.003):.5f}"


def in_nest_4(poses):
    """The SMR sat in nest 4 where the label says 5."""

    def change(rows):
        noise = np.random.default_rng(5)
        four = {row["pose"]: row for row in rows if row["nest"] == "4"}
        wrong = [row["nest"] == "5" and (poses is None or row["pose"] in poses) for row in rows]
        return [
            row | {axis: read_anew(four[row["pose"]][axis], noise) for axis in "xyz"}
            if bad
            else row
            for row, bad in zip(rows, wrong, strict=True)
        ]

    return change


def test_discover_bad_days_missing_channel_takes_its_effect_out_in_words(capsys, changed):
    run = changed("backlash-leg-3", without("structure_temp_C", "payload_kg"))
    report = answer(capsys, "diagnose", run)
    assert report["candidates"][0]["effect"] == "backlash"
    assert "thermal-growth" not in [c["effect"] for c in report["candidates"]]
    assert report["unavailable"]["thermal-growth"] == "the run has no column structure_temp_C"


def test_discover_bad_days_constant_channel_is_no_reason_for_alarm(capsys, changed):
    report = answer(capsys, "diagnose", changed("no-effect", having(structure_temp_C="20.0")))
    assert report["adequate"]


def test_discover_bad_days_kelvin_is_named(capsys, changed):
    def kelvin(rows):
        return [
            row | {"structure_temp_C": str(273.15 + float(row["structure_temp_C"]))} for row in rows
        ]

    report = answer(capsys, "diagnose", changed("screw-twist-and-heat", kelvin))
    assert [one["name"] for one in report["record"]] == ["temperature-in-kelvin"]
    assert "thermal-growth" not in report["unavailable"]
    assert report["candidates"][0]["effect"] == "screw-twist"


def test_discover_bad_days_gaps_in_a_channel_leave_their_rows_out_of_its_effect(capsys, changed):
    def gaps(rows):
        return [
            row | {"structure_temp_C": "nan"} if number % 7 == 3 else row
            for number, row in enumerate(rows)
        ]

    run = changed("screw-twist-and-heat", gaps)
    report = answer(capsys, "discover", run)
    assert report["effects"] == ["screw-twist", "thermal-growth"]
    assert pkmcal(["fit", run, "--add", "thermal-growth", "--json"]) == 0
    fitted = json.loads(capsys.readouterr().out)
    assert fitted["left_out_readings"] > 20
    assert fitted["readings"] + fitted["left_out_readings"] == 268


def test_discover_bad_days_wrong_hole_is_listed_and_the_effect_found(capsys, changed):
    run = changed("backlash-leg-3", in_nest_4(("11", "12", "13")))
    report = answer(capsys, "discover", run)
    assert report["effects"] == ["backlash"]
    assert {bad["why"] for bad in report["bad_readings"]} == {"reads as nest 4, was labelled 5"}
    assert len(report["bad_readings"]) == 3
    assert report["record"] == []
    assert report["adequate"]


def test_discover_bad_days_a_pass_in_another_hole_is_read_as_that_hole(capsys, changed):
    report = answer(capsys, "discover", changed("backlash-leg-3", in_nest_4(None)))
    (remark,) = report["record"]
    assert "Nest 5 reads as 4" in remark["says"]
    assert report["effects"] == ["backlash"]
    assert report["bad_readings"] == []


def test_discover_bad_days_two_passes_swapped_are_listed(capsys, changed):
    def swapped(rows):
        other = {"4": "5", "5": "4"}
        return [row | {"nest": other.get(row["nest"], row["nest"])} for row in rows]

    report = answer(capsys, "diagnose", changed("no-effect", swapped))
    assert [one["name"] for one in report["record"]] == ["nests-exchanged"]
    assert report["bad_readings"] == []
    assert report["adequate"]


def test_discover_bad_days_one_nest_is_enough(capsys, changed):
    run = changed("backlash-leg-3", only(lambda row: row["nest"] in ("", "3", "b1", "b2", "b3")))
    report = answer(capsys, "discover", run)
    assert report["steps"][1]["added"] == "backlash"
    assert report["steps"][1]["holdout_rms_um"] < report["steps"][0]["holdout_rms_um"]


def test_discover_bad_days_few_poses_are_said_to_show_little(capsys, changed):
    few = ("home", "", "1", "2", "3", "4", "5")
    run = changed("backlash-leg-3", only(lambda row: row["pose"] in few))
    report = answer(capsys, "discover", run)
    assert report["effects"] == []
    assert "With 5 poses only large effects would show" in report["advice"]


def test_discover_bad_days_stray_does_not_hide_the_effects(capsys, changed):
    def stray(rows):
        rows[100]["x"] = str(float(rows[100]["x"]) + 0.3)
        return rows

    report = answer(capsys, "discover", changed("screw-twist-and-heat", stray))
    assert report["effects"] == ["screw-twist", "thermal-growth"]
    assert [bad["line"] for bad in report["bad_readings"]] == [102]


def test_discover_bad_days_two_machines_cannot_be_mixed(capsys, changed, tmp_path):
    run = changed("no-effect", lambda rows: rows)
    toml = Path(run) / "run.toml"
    toml.write_text(toml.read_text().replace('"hexapod"', '"stewart"', 1))
    assert pkmcal(["diagnose", str(RUNS / "no-effect"), run, "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Fit runs of one machine together" in captured.err
