"""The example runs: discovery finds exactly what their truth files say."""

import json
from pathlib import Path

import pytest

from app.cli import run as pkmcal
from app.verbs.discover import words

RUNS = Path(__file__).parents[1] / "data" / "runs"


def answer(capsys, *arguments):
    assert pkmcal([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def truth(name):
    return json.loads((RUNS / name / "truth.json").read_text())["hidden"]


@pytest.mark.long
@pytest.mark.parametrize("name", ["no-effect", "backlash-leg-3", "screw-twist-and-heat"])
def test_discover_examples_find_what_is_hidden_and_nothing_else(capsys, name):
    report = answer(capsys, "discover", str(RUNS / name))
    hidden = truth(name)
    assert report["format"] == "pkm-discovery/1"
    assert set(report["effects"]) == {parameter.split(".")[0] for parameter in hidden}
    assert report["adequate"]
    assert not report["unexplained"]["significant"]
    assert report["bad_readings"] == []
    found = {entry["name"]: entry for entry in report["parameters"]}
    assert set(found) == set(hidden)
    for parameter, value in hidden.items():
        assert abs(found[parameter]["value"] - value) < 3 * found[parameter]["sigma"]


def test_discover_examples_mystery_reaches_its_floor_by_falling_steps(capsys):
    report = answer(capsys, "discover", str(RUNS / "mystery"))
    steps = report["steps"]
    assert steps[0]["added"] is None
    held = [step["holdout_rms_um"] for step in steps]
    assert held == sorted(held, reverse=True)
    assert held[-1] < 1.1 * steps[-1]["holdout_floor_um"]
    assert report["effects"] == [step["added"] for step in steps[1:]]
    assert report["adequate"]


@pytest.mark.long
def test_discover_examples_diagnosis_of_backlash(capsys):
    report = answer(capsys, "diagnose", str(RUNS / "backlash-leg-3"))
    assert report["format"] == "pkm-diagnosis/1"
    assert not report["adequate"]
    best = report["candidates"][0]
    assert best["effect"] == "backlash"
    assert best["p_value"] < 1e-20
    assert [entry["name"] for entry in best["parameters"]] == ["backlash.leg3"]
    assert best["holdout_rms_after_um"] < report["baseline"]["holdout_rms_um"]
    assert best["visible"] == pytest.approx(0.8, abs=0.1)
    assert not report["unexplained"]["significant"]
    assert "backlash" in report["advice"]


@pytest.mark.long
def test_discover_examples_diagnosis_promises_what_the_refit_keeps(capsys):
    before = answer(capsys, "diagnose", str(RUNS / "backlash-leg-3"))["candidates"][0]
    after = answer(capsys, "fit", str(RUNS / "backlash-leg-3"), "--add", "backlash")
    assert before["rms_after_um"] == pytest.approx(after["rms_um"], rel=1e-3)
    assert before["holdout_rms_after_um"] == pytest.approx(after["holdout_rms_um"], rel=1e-3)


@pytest.mark.long
def test_discover_examples_saved_model_begins_the_next_diagnosis(capsys, tmp_path):
    saved = tmp_path / "model.toml"
    run = str(RUNS / "backlash-leg-3")
    answer(capsys, "discover", run, "--save", str(saved))
    report = answer(capsys, "diagnose", run, "--model", str(saved))
    assert report["baseline"]["effects"] == ["backlash"]
    assert report["adequate"]


@pytest.mark.long
def test_discover_examples_same_answer_every_time(capsys):
    run = str(RUNS / "no-effect")
    assert answer(capsys, "diagnose", run) == answer(capsys, "diagnose", run)


@pytest.mark.long
def test_discover_examples_what_was_put_in_is_not_called_found(capsys):
    assert pkmcal(["discover", str(RUNS / "backlash-leg-3"), "--add", "tracker-scale"]) == 0
    said = capsys.readouterr().out
    assert "effects put in: tracker-scale" in said
    assert "effects found: backlash" in said


def test_discover_examples_refused_effects_are_told(capsys):
    report = answer(capsys, "discover", str(RUNS / "no-effect"))
    assert "Refused" not in words(report)
    said = words({**report, "refused": ["screw-twist"]})
    assert "Refused, held-out poses being predicted worse with it: screw-twist" in said
