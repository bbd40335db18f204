"""A tracker's run and a gauge's of one machine, fitted together: what each knows counts."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.cli import run
from calib.errors import BadInput
from calib.identify import fit
from calib.mechanism.solve import forward
from calib.model import Model
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.kinds import Laboratory
from tests.kinds.conftest import everything
from tests.mechanism.conftest import load, reachable


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run of version 1 of three SMRs, and heights and marks on a part by the same delta."""
    folder = tmp_path_factory.mktemp("two")
    first, second = folder / "tracker", folder / "part"
    assert run(["simulate", "delta", "--poses", "12", "--seed", "3", "--out", str(first)]) == 0
    machine = load("delta")
    real = machine.vector(json.loads((first / "truth.json").read_text())["parameters"])
    ways = reachable(machine, 14, seed=8)
    at = forward(machine, ways.extension, real).poses
    q = machine.coordinates(ways.extension)
    header = {
        "machine": "delta",
        "nests": {"platform": {"tool": [0.0, 0.0, 0.0]}, "base": {}},
        "instruments": {"probe": {"frame": "base"}, "calipers": {"frame": "base"}},
    }
    lab = Laboratory(header, {"tool": np.zeros(3)}, {}, 3, np.random.default_rng(2))
    for k in range(14):
        lab.go(f"{k}", q[:, k].tolist(), at.position[:, k], at.rotation[:, :, k])
        lab.point("tool", 0.01, by="probe", only="z")
    for k in range(7):
        lab.marks("tool", f"{k}", f"{k + 7}", 0.02, by="calipers")
    second.mkdir()
    for name, text in zip(("run.toml", "points.csv"), lab.texts(), strict=True):
        (second / name).write_text(text)
    return first, second


def test_runs_of_two_instruments_are_one_fit(
    two: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said, names = {}, [str(one) for one in two]
    residuals = tmp_path / "residuals.csv"
    for runs in (names[:1], names[1:], names):
        capsys.readouterr()
        assert run(["fit", *runs, "--residuals", str(residuals), "--json"]) == 0
        said[len(runs), runs[0]] = json.loads(capsys.readouterr().out)
    tracker, part, both = said[1, names[0]], said[1, names[1]], said[2, names[0]]
    assert both["readings"] == tracker["readings"] + part["readings"]
    assert [one["kind"] for one in both["by_kind"]] == ["point", "distance"]
    # The second mark of a distance is no reading, and nothing that lacks a channel.
    assert part["readings"] == 21
    assert both["left_out_readings"] == part["left_out_readings"] == 0
    assert len(residuals.read_text().splitlines()) == 1 + both["readings"]
    truth = json.loads((two[0] / "truth.json").read_text())["parameters"]
    sigma = {one["name"]: one["sigma"] for one in both["parameters"] if one["name"] in truth}
    for alone in (tracker, part):
        for one in alone["parameters"]:
            if one["name"] in truth:
                assert sigma[one["name"]] <= one["sigma"] * (1.0 + 1e-6)
    pulls = [
        (one["value"] - truth[one["name"]]) / one["sigma"]
        for one in both["parameters"]
        if one["name"] in truth
    ]
    assert np.max(np.abs(pulls)) < 4.5


def test_readings_that_cannot_tell_actuators_apart_name_no_error_of_them(
    two: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """Heights and marks: one or two numbers a pose for three actuators."""
    assert run(["compare", str(two[1]), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["actuators"] == []


def test_a_plane_that_lies_elsewhere_in_another_run_is_refused() -> None:
    machine = load("delta")
    lab = everything(machine, seed=2, poses=4, share=0.2)
    one = parse_run(*lab.texts(), actuators=3)
    assert fit(Model(stack(machine, [one, one]))).model.frames == 6
    lab.header["planes"]["bed"]["through"][2] -= 1.0
    with pytest.raises(BadInput, match="plane bed lies elsewhere"):
        stack(machine, [one, parse_run(*lab.texts(), actuators=3)])


def test_a_record_says_what_took_its_readings(two: tuple[Path, Path], tmp_path: Path) -> None:
    file = tmp_path / "record.html"
    pages = []
    for runs in (two[1:], two):
        assert run(["report", *map(str, runs), "--out", str(file)]) == 0
        pages.append(file.read_text(encoding="utf-8"))
    for page in pages:
        assert "The instrument probe took 14 readings of the kind point at 14 poses." in page
        assert "The instrument calipers took 7 readings of the kind distance" in page
    assert "laser tracker" not in pages[0]
    assert "reflector" not in pages[0]
    assert "A laser tracker measured the centre of a reflector in 3 nests" in pages[1]
