"""Runs as strangers bring them: machines mixed, tracker moved, untrue sigmas, a run named twice."""

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from app.cli import run as pkmcal
from mocks.hidden.table import Hidden
from mocks.simulate import RunPlan, simulate
from mocks.simulate.files import write

pytestmark = pytest.mark.long

RUNS = Path(__file__).parents[1] / "data" / "runs"
CLEAN = RUNS / "no-effect"


@pytest.fixture
def changed(tmp_path):
    """The run without an effect, its rows (dicts of text) changed by a function."""

    def make(change):
        folder = tmp_path / "run"
        folder.mkdir()
        (folder / "run.toml").write_text((CLEAN / "run.toml").read_text())
        rows = change(list(csv.DictReader(io.StringIO((CLEAN / "points.csv").read_text()))))
        with (folder / "points.csv").open("w", newline="") as target:
            writer = csv.DictWriter(target, rows[0].keys(), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        return str(folder)

    return make


def answer(capsys, *arguments):
    assert pkmcal([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_discover_outsiders_two_machines_are_told_in_words(capsys):
    runs = [CLEAN, RUNS / "backlash-leg-3"]
    assert "do not agree" in answer(capsys, "fit", *runs)["remarks"][0]


def test_discover_outsiders_one_run_alone_has_no_remark(capsys):
    assert answer(capsys, "fit", CLEAN)["remarks"] == []


def test_discover_outsiders_moved_tracker_is_told(capsys, changed):
    turn = np.array([[np.cos(0.02), -np.sin(0.02)], [np.sin(0.02), np.cos(0.02)]])

    def move(rows):
        for row in rows[2 * len(rows) // 3 :]:
            if row["nest"]:
                x, y = turn @ [float(row["x"]), float(row["y"])] + [30.0, 0.0]
                row |= {"x": f"{x:.6f}", "y": f"{y:.6f}"}
        return rows

    found = answer(capsys, "diagnose", changed(move))
    assert [one["name"] for one in found["record"]] == ["station-moved"]
    assert found["baseline"]["effects"] == ["frame-shift"]
    assert found["bad_readings"] == []
    assert found["adequate"]


@pytest.mark.parametrize(("sigma", "said"), [("0.0005", "10 times"), ("0.05", "only 0.1")])
def test_discover_outsiders_untrue_uncertainties_are_told(capsys, changed, sigma, said):
    def claim(rows):
        return [
            row | dict.fromkeys(("sx", "sy", "sz"), sigma if row["nest"] else "") for row in rows
        ]

    assert said in answer(capsys, "diagnose", changed(claim))["advice"]


def test_discover_outsiders_base_readings_alone_end_in_an_answer(capsys, changed):
    run = changed(lambda rows: [row for row in rows if row["nest"].startswith("b")])
    assert "nest-offset" in answer(capsys, "diagnose", run)["unavailable"]


def test_discover_outsiders_poses_without_labels_are_counted(capsys, changed):
    run = changed(lambda rows: [row | {"pose": ""} for row in rows])
    assert "poses only" not in answer(capsys, "diagnose", run)["advice"]


def test_discover_outsiders_empty_payload_is_told(capsys, changed):
    run = changed(lambda rows: [row | {"payload_kg": ""} for row in rows])
    found = answer(capsys, "diagnose", run)
    assert found["unavailable"]["gravity-sag"] == "the column payload_kg is empty"


def test_discover_outsiders_run_named_twice_is_refused(capsys):
    assert pkmcal(["fit", str(CLEAN), str(CLEAN)]) == 2
    assert "every run once" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["fit", "RUN", "--save", "RUN/run.toml"],
        ["discover", "RUN", "--save", "RUN/model.toml"],
        ["compare", "RUN", "--propose", "RUN/points.csv"],
        ["compare", "RUN", "--out", "RUN"],
        ["report", "RUN", "--out", "RUN/report.html"],
        ["design", "RUN", "--discriminate", "backlash", "settling", "--out", "RUN/poses.toml"],
    ],
)
def test_discover_outsiders_run_folder_is_never_written_to(capsys, changed, arguments):
    run = changed(lambda rows: rows)
    before = {path: path.read_bytes() for path in Path(run).iterdir()}
    assert pkmcal([text.replace("RUN", run) for text in arguments]) == 2
    assert "never written to" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in Path(run).iterdir()} == before


EFFECT = """[effect]
id = "{id}"
says = "the legs swell"
acts_on = "actuator"
expression = "k * {channel}"
unknowns = {{ k = "mm" }}
"""


@pytest.mark.parametrize(
    ("id_", "channel", "said"),
    [
        ("swelling", "humidity", "no column humidity"),
        ("backlash", "air_temp_C", "line 2, id: the id 'backlash' is that of an effect"),
    ],
)
@pytest.mark.parametrize("verb", ["fit", "diagnose"])
def test_discover_outsiders_own_effect_that_cannot_be_is_refused(
    capsys, tmp_path, verb, id_, channel, said
):
    path = tmp_path / "own.toml"
    path.write_text(EFFECT.format(id=id_, channel=channel))
    assert pkmcal([verb, str(CLEAN), "--add", str(path)]) == 2
    assert said in capsys.readouterr().err


def test_discover_outsiders_wrong_machine_file_makes_no_bad_readings(capsys, changed):
    run = Path(changed(lambda rows: rows))
    text = (run / "run.toml").read_text()
    (run / "run.toml").write_text(text.replace('"hexapod"', '"hexapod-universal"'))
    found = answer(capsys, "discover", run)
    assert found["bad_readings"] == []
    assert found["effects"] == ["joint-offset"]


def test_discover_outsiders_every_pass_in_another_hole_is_told(capsys, changed):
    holes = {"3": "4", "4": "5", "5": "3"}
    run = changed(lambda rows: [r | {"nest": holes.get(r["nest"], r["nest"])} for r in rows])
    (remark,) = answer(capsys, "fit", run)["record"]
    assert remark["name"] == "nests-exchanged"
    for label, hole in holes.items():
        assert f"nest {hole} reads as {label}" in remark["says"]


@pytest.mark.parametrize("period", [400.0, 1020.0])
def test_discover_outsiders_period_in_time_is_named(capsys, tmp_path, period):
    tide = {"unknown.tide.amplitude": 0.02, "unknown.tide.period": period}
    write(simulate(RunPlan(seed=41, poses=60, noise_mm=0.005, hidden=Hidden(tide))), tmp_path)
    found = answer(capsys, "diagnose", tmp_path)
    assert found["unexplained"]["channels"][0] == "time_s"
    assert found["unexplained"]["periods"]["time_s"] == pytest.approx(period, rel=0.03)
    assert found["noise"]["components"] == []
    told = re.findall(r"period of ([\d.]+) min", found["advice"])
    assert told
    assert [float(one) for one in told] == pytest.approx([period / 60.0] * len(told), rel=0.05)
