"""A run says what the controller compensated, and a model file keeps it."""

import tomllib
from pathlib import Path

import pytest

from app.files.fits import read_fit
from app.files.models import write_model
from app.files.runs import read_run
from calib.errors import BadInput
from calib.identify import fit
from calib.model import Model
from calib.runs import format_run
from calib.runs.stack import stack

RUN = Path(__file__).parents[1] / "data" / "runs" / "no-effect"
USED = {"screw-pitch.leg2": 2e-4, "backlash.leg3": 0.01}


def compensated(folder: Path, text: str) -> Path:
    folder.mkdir()
    (folder / "points.csv").write_text((RUN / "points.csv").read_text())
    (folder / "run.toml").write_text((RUN / "run.toml").read_text() + text)
    return folder


def test_compensation_goes_from_the_run_to_the_model_file_to_the_write_back(tmp_path: Path) -> None:
    lines = [f'"{name}" = {value}' for name, value in USED.items()]
    run = compensated(tmp_path / "run", "\n[controller.compensation]\n" + "\n".join(lines) + "\n")
    loaded = read_run(run)
    assert loaded.run.header.compensation == USED
    assert tomllib.loads(format_run(loaded.run)[0])["controller"]["compensation"] == USED
    model = tmp_path / "model.toml"
    write_model(model, fit(Model(stack(loaded.machine, [loaded.run]))))
    assert read_fit(model).compensation == USED


def test_a_run_that_says_nothing_compensates_nothing() -> None:
    assert read_run(RUN).run.header.compensation == {}


def test_a_value_that_is_no_number_is_named(tmp_path: Path) -> None:
    run = compensated(tmp_path / "run", '\n[controller.compensation]\n"backlash.leg3" = "much"\n')
    with pytest.raises(BadInput, match=r"run\.toml.*backlash\.leg3|much"):
        read_run(run)
