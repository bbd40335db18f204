"""A write-back killed half way: motion is refused until the known set is back."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from session_mock import POSES, Mock

from app.files.pose_table import poses_text


def program(*arguments: str) -> list[str]:
    return [sys.executable, "-c", "from app.cli import main; main()", *arguments]


def cli(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        program(*arguments), cwd=folder, env=os.environ, capture_output=True, text=True, timeout=100
    )


def small_change(mock: Mock) -> str:
    """A saved fit: nominal, but for one leg's length."""
    parameters = [
        {
            "name": p.name, "value": p.nominal + (0.02 if p.name == "leg1.L0" else 0.0),
            "sigma": 1e-3, "unit": "mm", "nominal": p.nominal, "identified": True,
        }
        for p in mock.site.machine.parameters
    ]  # fmt: skip
    quality = {"chi2_per_dof": 1.0, "holdout_rms_um": 9.0, "holdout_floor_um": 9.0}
    return json.dumps({"format": "pkm-fit/1", "effects": [], "parameters": parameters, **quality})


@pytest.mark.long
def test_a_killed_write_back_is_noticed_and_undone(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=600)
    site = str(mock.site_file(tmp_path))
    (tmp_path / "fit.json").write_text(small_change(mock), encoding="utf-8")
    (tmp_path / "poses.csv").write_text(poses_text({k: POSES[k] for k in "ab"}), encoding="utf-8")
    process = subprocess.Popen(
        program("apply", "fit.json", "--site", site, "--yes"),
        cwd=tmp_path, env=os.environ, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    said = []
    for line in process.stderr:
        said.append(line)
        if "read-back" in line:
            break
    process.kill()
    process.communicate()
    assert "read-back" in said[-1], said
    measure = ["measure", "--site", site, "--poses", "poses.csv", "--no-warm-up"]
    refused = cli(tmp_path, *measure)
    assert refused.returncode == 3
    assert "leg1.L0" in refused.stderr
    assert "pkmcal undo" in refused.stderr
    undone = cli(tmp_path, "undo", "--site", site, "--json")
    assert undone.returncode == 0, undone.stderr
    assert json.loads(undone.stdout)["restored"] == 1
    assert cli(tmp_path, *measure).returncode == 0
