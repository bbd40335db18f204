"""`pkmcal correct`: from a model file and wanted poses to commands, or to a refusal in words."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from app.cli import run
from app.files.fits import read_fit
from app.files.machines import load_machine
from app.files.models import chosen_effects
from calib.command import Identified, Surroundings, standpoint
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import forward, inverse

HOME = "0, 0, 220, 0, 0, 0"
TABLE = """pose,x,y,z,rx,ry,rz,payload_kg
up,1.0,-2.0,222.0,0.02,-0.03,0.01,0.0
down,-3.0,2.0,214.0,-0.05,0.04,0.0,5.0
again,1.0,-2.0,222.0,0.02,-0.03,0.01,2.5
"""


def said(capsys: pytest.CaptureFixture[str]) -> dict:
    return json.loads(capsys.readouterr().out)


def test_correct_brings_the_machine_of_the_model_to_the_poses_of_a_table(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "wanted.csv"
    table.write_text(TABLE)
    out = tmp_path / "commands.csv"
    code = run(["correct", str(model), "--poses", str(table), "--out", str(out), "--json"])
    assert code == 0
    answer = said(capsys)
    assert answer["effects"] == ["gravity-sag", "backlash"]
    assert "of the measurement" in answer["left_out"]["tracker-scale"]
    saved, machine = read_fit(model), load_machine("hexapod")
    values = {name: one.value for name, one in saved.estimates.items()}
    identified = Identified.from_values(
        machine, values, chosen_effects(machine, (), model), saved.load, saved.controller
    )
    q = np.array([one["q"] for one in answer["poses"]]).T
    here = Surroundings({"payload_kg": np.array([0.0, 5.0, 2.5])})
    stands = standpoint(identified, machine.extension(q, saved.controller), here)
    wanted = np.array([list(map(float, row.split(",")[1:7])) for row in TABLE.split()[1:]]).T
    assert np.allclose(stands.poses.to_xyz_rpy(), wanted, atol=1e-7)
    rows = list(csv.reader(out.read_text().splitlines()))
    assert rows[0] == ["pose", *(f"q{k}" for k in range(1, 7))]
    assert [row[0] for row in rows[1:]] == ["up", "down", "again"]
    assert np.array_equal(np.array([row[1:] for row in rows[1:]], dtype=float).T, q)


def test_correct_as_pose_is_what_the_controller_of_the_run_makes_the_same_q_of(
    model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ask = ["correct", str(model), "--pose", HOME, "--payload", "2.5"]
    assert run([*ask, "--as", "pose", "--json"]) == 0
    answer = said(capsys)
    machine, held = load_machine("hexapod"), read_fit(model).controller
    told = Poses.from_xyz_rpy(np.array(answer["poses"][0]["pose"])[:, None])
    sent = inverse(machine, told, machine.vector(held))
    q = machine.coordinates(sent.extension, held)[:, 0]
    assert np.allclose(q, answer["poses"][0]["q"], atol=1e-7)
    drawn = forward(machine, sent.extension).poses.position[:, 0]
    assert np.linalg.norm(drawn - [0, 0, 220]) > 0.01  # nothing to correct would prove nothing
    assert run([*ask, "--as", "pose"]) == 0
    assert "in the commands: gravity-sag, backlash" in capsys.readouterr().out


def test_correct_in_a_script_is_the_verb(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = pkmcal.correct(model, {"the pose": (0, 0, 220, 0, 0, 0)}, payload=2.5)
    assert run(["correct", str(model), "--pose", HOME, "--payload", "2.5", "--json"]) == 0
    assert found.to_json() == said(capsys)
    assert 0.5 < found.poses[0].uncertainty_um < 50.0
    later = pkmcal.correct(model, [(0, 0, 220, 0, 0, 0)], payload=2.5, before=(0, 0, 225, 0, 0, 0))
    change = np.array(later.poses[0].q) - found.poses[0].q
    lost = read_fit(model).estimates["backlash.leg1"].value
    assert abs(change[0]) == pytest.approx(lost, abs=0.01)  # it comes from the other side


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--pose", HOME], 2, "gravity-sag depends on payload_kg"),
        (["--pose", "0 0 220 0 0", "--payload", "1"], 2, "5 numbers are no pose of hexapod"),
        (["--pose", "0 0 220 0 x 0", "--payload", "1"], 2, "--pose, ry: 'x' is not a number"),
        (["--pose", "0 0 220 0 2mm 0", "--payload", "1"], 2, "A value in rad"),
        (["--pose", "0 0 900 0 0 0", "--payload", "1"], 2, "the pose: it"),
        (["--pose", "0 0 246 0 0 0", "--payload", "1"], 5, "mm beyond what was measured"),
        (["--pose", HOME, "--payload", "9"], 5, "payload_kg is 4 kg beyond"),
        (["--pose", HOME, "--channel", "payload_kg"], 2, "Write NAME=VALUE"),
        (["--pose", HOME, "--payload", "-1"], 2, "payload_kg is negative"),
        (["--pose", HOME, "--payload", "1", "--channel", "payload_kg=2"], 2, "told twice"),
        (["--payload", "1"], 2, "no pose is given"),
        (["--serve", "--pose", HOME], 2, "--pose is no option of --serve"),
        (["--pose", HOME, "--machine", "tripod"], 2, 'not of "tripod"'),
    ],
)
def test_correct_refuses_in_words(
    model: Path, options: list[str], code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["correct", str(model), *options]) == code
    assert words in capsys.readouterr().err


def test_correct_extrapolates_when_told_and_says_how_far(
    model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ask = ["correct", str(model), "--pose", "0 0 246 0 0 0", "--payload", "9", "--extrapolate"]
    assert run([*ask, "--json"]) == 0
    outside = said(capsys)["poses"][0]["outside"]
    assert any("z is " in one for one in outside)
    assert any("payload_kg is 4 kg beyond" in one for one in outside)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("pose,x", "pose,u", "there is no column x"),
        ("0.02,", "wide,", "line 2, column rx"),
        (",2.5", "", "6 cells"),
        ("payload_kg", "x", "'x' is there twice"),
        (TABLE[TABLE.index("up") :], "", "there is no pose"),
    ],
)
def test_correct_names_what_is_wrong_with_a_table(
    model: Path, tmp_path: Path, old: str, new: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "wanted.csv"
    table.write_text(TABLE.replace(old, new))
    assert run(["correct", str(model), "--poses", str(table)]) == 2
    text = capsys.readouterr().err
    assert words.replace("6 cells", "7 cells") in text
    assert "wanted.csv" in text


def test_correct_reads_models_of_before_and_says_that_the_region_is_unknown(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = model.read_text()
    start = text.index("[measured]")
    end = text.index("[correlations]")
    old = tmp_path / "old.toml"
    old.write_text(text[:start] + text[end:])
    assert run(["correct", str(old), "--pose", "0 0 246 0 0 0"]) == 0
    assert "does not say where it was measured" in capsys.readouterr().err
    empty = tmp_path / "empty.toml"
    empty.write_text('format = "pkm-model/1"\nmachine = "hexapod"\neffects = ["backlash"]\n')
    assert run(["correct", str(empty), "--pose", HOME]) == 2
    assert "it has no value of leg1" in capsys.readouterr().err


def test_correct_finds_a_machine_file_of_the_lab_beside_the_model(tmp_path: Path) -> None:
    text = (Path(pkmcal.__file__).parents[1] / "calib" / "machines" / "delta.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace('name = "delta"', 'name = "mine"', 1))
    pkmcal.simulate(str(tmp_path / "mine.toml"), tmp_path / "run", seed=2, poses=14)
    (tmp_path / "models").mkdir()
    pkmcal.fit(tmp_path / "run").save(tmp_path / "models" / "m.toml")
    assert read_fit(tmp_path / "models" / "m.toml").machine_file == "../mine.toml"
    home = load_machine("delta").home[:3]
    found = pkmcal.correct(tmp_path / "models" / "m.toml", [home], extrapolate=True)
    assert found.machine == "mine"
    assert np.allclose(found.poses[0].stands[:3], home, atol=1e-7)
