"""Any machine file gives a run, and the run gives the machine back."""

import json
from importlib.resources import files
from pathlib import Path

import pytest

from app.cli import run
from app.files.runs import read_run
from calib.identify import fit
from calib.model import Model
from calib.runs.stack import stack


@pytest.mark.parametrize("name", ["delta", "stewart", "arm", "hexapod-universal"])
def test_a_virtual_prototype_is_identified(tmp_path: Path, name: str) -> None:
    assert run(["simulate", name, "--out", str(tmp_path / "run"), "--seed", "3", "--json"]) == 0
    loaded = read_run(tmp_path / "run")
    found = fit(Model(stack(loaded.machine, [loaded.run])))
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.2)
    truth = json.loads((tmp_path / "run" / "truth.json").read_text())["parameters"]
    count = found.model.free.size
    true = loaded.machine.vector(truth)[found.model.free]
    assert abs((found.values[:count] - true) / found.sigmas[:count]).max() < 4.5


def test_a_machine_file_of_ones_own_is_named_from_the_run(tmp_path: Path) -> None:
    own = tmp_path / "mine.toml"
    own.write_text(files("calib.machines").joinpath("delta.toml").read_text())
    out = tmp_path / "runs" / "first"
    assert run(["simulate", str(own), "--out", str(out), "--poses", "20", "--json"]) == 0
    assert read_run(out).machine.name == "delta"


def test_a_fit_says_that_a_file_takes_too_much_for_granted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Towers that lean, fitted as those of printers: more is left than noise, and it is said."""
    out = tmp_path / "run"
    assert run(["simulate", "delta", "--out", str(out), "--poses", "20", "--seed", "1"]) == 0
    header, said = out / "run.toml", {}
    for machine in ("delta", "delta-printer"):
        header.write_text(header.read_text().replace('"delta"', f'"{machine}"'))
        capsys.readouterr()
        assert run(["fit", str(out), "--json"]) == 0
        said[machine] = json.loads(capsys.readouterr().out)
    assert said["delta"]["p_value"] > 0.01
    assert not any("More is left" in one for one in said["delta"]["remarks"])
    assert said["delta-printer"]["log10_p"] < -10.0
    assert any("More is left" in one for one in said["delta-printer"]["remarks"])


def test_hidden_effects_need_a_mock(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "simulate",
        "delta",
        "--out",
        str(tmp_path / "r"),
        "--effect",
        "backlash.tower1=0.1",
    ]
    assert run(arguments) == 2
    assert "virtual prototype" in capsys.readouterr().err


def test_an_unknown_machine_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "octopod", "--out", str(tmp_path / "r")]) == 2
    assert "octopod" in capsys.readouterr().err
