"""The scripting interface answers what the verbs answer, to the last digit."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import pkmcal
from app.cli import run
from app.jobs.record import Record, Report


def asked(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """What a verb prints with --json."""
    capsys.readouterr()
    assert run([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def wholly(record: Record) -> Any:
    """A record's fields as plain data, without those that are not declared in its JSON."""

    def plain(value: Any) -> Any:
        if isinstance(value, Record):
            return wholly(value)
        if isinstance(value, tuple):
            return [plain(item) for item in value]
        if isinstance(value, dict):
            return {key: plain(item) for key, item in value.items()}
        return value

    return {
        f.name.rstrip("_"): plain(getattr(record, f.name))
        for f in dataclasses.fields(record)
        if not f.name.startswith("_")
    }


def agree(fields: Any, said: Any) -> None:
    """Every key of an answer is a field of its record, with the same value."""
    if isinstance(said, dict):
        if "coordinates" in fields and "coordinates" not in said:  # a pose's lie flat in JSON
            fields = {**fields, **fields["coordinates"]}
        for key, value in said.items():
            if key != "format":
                agree(fields[key], value)
    elif isinstance(said, list):
        assert len(fields) == len(said)
        for one, other in zip(fields, said, strict=True):
            agree(one, other)
    else:
        assert fields == said


QUESTIONS: dict[str, tuple[Callable[[str], Report], Callable[[str], list[str]]]] = {
    "fit": (lambda r: pkmcal.fit(r), lambda r: ["fit", r]),
    "fit, an effect added": (
        lambda r: pkmcal.fit([r], add=["backlash"]),
        lambda r: ["fit", r, "--add", "backlash"],
    ),
    "compare": (lambda r: pkmcal.compare(r), lambda r: ["compare", r]),
    "diagnose": (lambda r: pkmcal.diagnose(r), lambda r: ["diagnose", r]),
    "discover": (lambda r: pkmcal.discover(r), lambda r: ["discover", r]),
    "design": (
        lambda r: pkmcal.design(r, ("gravity-sag", "nothing"), 3, candidates=30),
        lambda r: [
            *("design", r, "--discriminate", "gravity-sag", "nothing"),
            *("--n", "3", "--candidates", "30"),
        ],
    ),
    "poses": (
        lambda r: pkmcal.choose_poses("tripod", 6, candidates=12),
        lambda r: ["poses", "tripod", "--n", "6", "--candidates", "12"],
    ),
    "verification grid": (
        lambda r: pkmcal.verification_grid("hexapod"),
        lambda r: ["poses", "hexapod", "--verification"],
    ),
    "machine check": (
        lambda r: pkmcal.check_machine("tripod"),
        lambda r: ["machine", "check", "tripod"],
    ),
    "sensitivity": (
        lambda r: pkmcal.sensitivity("tripod", poses=5, position_um=100.0),
        lambda r: ["sensitivity", "tripod", "--poses", "5", "--position-um", "100"],
    ),
    "identifiability": (
        lambda r: pkmcal.identifiability("tripod", poses=8, read="positions", base_nests=False),
        lambda r: [
            *("identifiability", "tripod", "--poses", "8", "--read", "positions"),
            "--no-base-nests",
        ],
    ),
    "site kinds": (lambda r: pkmcal.site_kinds("gcs"), lambda r: ["site", "kinds", "gcs"]),
}


@pytest.mark.long
@pytest.mark.parametrize("question", QUESTIONS)
def test_script_and_verb_answer_alike(
    question: str, run_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call, words = QUESTIONS[question]
    report = call(str(run_folder))
    said = asked(capsys, *words(str(run_folder)))
    assert report.to_json() == said
    agree(wholly(report), said)


def test_a_simulated_run_is_the_verbs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    report = pkmcal.simulate("tripod", ours, seed=3, poses=4, effects={"backlash.limb1": 0.01})
    words = ("--seed", "3", "--poses", "4", "--effect", "backlash.limb1=0.01")
    said = asked(capsys, "simulate", "tripod", "--out", str(theirs), *words)
    for name in ("run.toml", "points.csv", "truth.json"):
        assert (ours / name).read_bytes() == (theirs / name).read_bytes()
    places = ("run", "truth")
    assert {k: v for k, v in report.to_json().items() if k not in places} == {
        k: v for k, v in said.items() if k not in places
    }


def test_a_saved_model_is_the_verbs(
    run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs = tmp_path / "ours.toml", tmp_path / "theirs.toml"
    pkmcal.fit(run_folder).save(ours)
    asked(capsys, "fit", str(run_folder), "--save", str(theirs))
    assert ours.read_text("utf-8") == theirs.read_text("utf-8")
    with pytest.raises(pkmcal.BadInput, match="never written to"):
        pkmcal.fit(run_folder).save(run_folder / "model.toml")


def test_saved_poses_are_read_back(tmp_path: Path) -> None:
    chosen = pkmcal.choose_poses("hexapod", 4, candidates=40)
    for name in ("poses.toml", "poses.csv"):
        chosen.save(tmp_path / name)
        again = pkmcal.simulate(
            "hexapod", tmp_path / f"run-of-{name}", poses=tmp_path / name, seed=1
        )
        assert again.poses == 4
    labels = [pose.label for pose in chosen.poses]
    assert labels == list(chosen.by_label())
    assert set(chosen.poses[0].coordinates) == {"x", "y", "z", "rx", "ry", "rz"}


def test_readings_are_arrays(run_folder: Path) -> None:
    rows = pkmcal.load_runs(run_folder)
    count = pkmcal.fit(run_folder).readings
    assert rows.position.shape == (3, count)
    assert rows.covariance.shape == (3, 3, count)
    assert rows.machine.name == "hexapod"


def test_parameters_by_name(run_folder: Path) -> None:
    found = pkmcal.fit(run_folder, add=["backlash"])
    play = found["backlash.leg3"]
    assert play.unit == "mm"
    assert abs(play.value - 0.03) < 5.0 * play.sigma
    with pytest.raises(KeyError):
        found["backlash.leg9"]


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: pkmcal.fit("absent"), "no such folder"),
        (lambda: pkmcal.choose_poses(), "no machine is named"),
        (lambda: pkmcal.choose_poses("hexapod", 0), "n is 0"),
        (lambda: pkmcal.simulate("hexapod", "new", noise_um=-1.0), "must be positive"),
        (lambda: pkmcal.simulate("hexapod", "new", poses=0), "at least 1"),
        (lambda: pkmcal.Station("absent.toml"), "absent.toml"),
    ],
)
def test_bad_input_is_said(call: Callable[[], object], says: str) -> None:
    with pytest.raises(pkmcal.BadInput, match=says):
        call()


def test_a_record_takes_no_key_that_is_not_declared() -> None:
    with pytest.raises(TypeError, match="novel"):
        pkmcal.SessionReport.of(
            {"format": "pkm-session/1", "session": "a", "run": "b", "readings": 1, "novel": 0}
        )
