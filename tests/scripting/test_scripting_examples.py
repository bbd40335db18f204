"""The example scripts do what their README says."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PRINTS = {
    "analyse_a_run": ("Add backlash", "backlash.leg3 = 0.0", "any more: True"),
    "night_shift": ("54 parameters written", "after: peak error", "set 1 is in the controller"),
    "how_many_poses": ("60 poses:", "machine 5: ", "times the stated uncertainties"),
}


@pytest.mark.timeout(180)
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.long) if n == "night_shift" else n for n in PRINTS],
)
def test_an_example_runs_and_prints_what_it_finds(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py")],
        cwd=tmp_path,
        env={**os.environ, "PKMCAL_STATE": str(tmp_path / "state")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for words in PRINTS[name]:
        assert words in done.stdout


def test_every_example_is_listed_and_tried() -> None:
    there = {path.stem for path in EXAMPLES.glob("*.py")}
    assert there == set(PRINTS)
    listed = (EXAMPLES / "README.md").read_text("utf-8")
    assert all(f"({name}.py)" in listed for name in there)
