import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from app.files.machines import load_machine
from app.files.poses import parse_pose_file, read_any_poses, read_pose_file
from app.verbs.poses import command
from calib.errors import BadInput

GOOD = """format = "pkm-poses/1"
machine = "hexapod"

[poses]
p01 = { x = 1.0, y = -2.0, z = 221.0, rx = "2 deg", ry = 0.01, rz = 0 }
p02 = { x = 0, y = 0, z = 220, rx = 0, ry = 0, rz = 0 }
"""


def test_what_the_verb_writes_is_read_back(tmp_path: Path) -> None:
    out = tmp_path / "poses.toml"
    arguments = ["hexapod", "--n", "12", "--candidates", "200", "--out", str(out), "--json"]
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    machine = load_machine("hexapod")
    found = read_pose_file(out, machine)
    assert list(found.labels) == [row["label"] for row in answer["poses"]]
    expected = np.array(
        [[row[k] for k in ("x", "y", "z", "rx", "ry", "rz")] for row in answer["poses"]]
    )
    assert np.max(np.abs(np.array(list(found.by_label.values())) - expected)) < 1e-9
    assert found.design["predicted_position_rms_um"] == pytest.approx(
        answer["predicted"]["position_rms_um"], abs=0.01
    )
    assert [row["n"] for row in answer["by_count"]] == list(range(10, 61))


def test_the_verification_grid_is_a_poses_file_too(tmp_path: Path) -> None:
    out = tmp_path / "grid.toml"
    result = CliRunner().invoke(command, ["hexapod", "--verification", "--out", str(out)])
    assert result.exit_code == 0
    assert len(read_pose_file(out, load_machine("hexapod")).labels) == 216


def test_a_file_written_by_hand() -> None:
    found = parse_pose_file(GOOD, "hand.toml", load_machine("hexapod"))
    assert found.by_label["p01"] == pytest.approx((1.0, -2.0, 221.0, np.deg2rad(2.0), 0.01, 0.0))
    assert found.pose_set.q[:, 1] == pytest.approx(np.full(6, 230.7148097226), abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "line", "what"),
    [
        ("z = 221.0", "z = 320.0", 5, 'pose "p01" is out of reach'),
        ("z = 221.0, ", "", 5, "z is missing"),
        ("z = 220", "w = 220", 6, 'unknown key "w"'),
        ("rx = 0,", 'rx = "3 mm",', 6, "does not measure"),
        ("rx = 0,", "rx = nan,", 6, "not finite"),
        ('"hexapod"', '"tripod"', 2, 'these poses are for "tripod"'),
        ("rz = 0 }\np02", "rz = 0, q = [1, 2, 3, 4, 5, 6] }\np02", 5, "q of pose"),
        ("pkm-poses/1", "pkm-poses/9", 1, "pkm-poses/9"),
        ("p02 = {", "p02 = 7 # {", 6, "p02 is 7"),
    ],
)
def test_faults_are_named_with_their_line(old: str, new: str, line: int, what: str) -> None:
    assert old in GOOD
    with pytest.raises(BadInput, match=what) as caught:
        parse_pose_file(GOOD.replace(old, new), "hand.toml", load_machine("hexapod"))
    assert "hand.toml" in caught.value.place
    assert f"line {line}" in str(caught.value)


def test_an_empty_list_is_refused() -> None:
    with pytest.raises(BadInput, match="there is no pose"):
        parse_pose_file('format = "pkm-poses/1"\n[poses]\n', "x.toml", load_machine("hexapod"))


def test_a_table_of_six_coordinates_is_read_and_written(tmp_path: Path) -> None:
    out = tmp_path / "poses.csv"
    arguments = ["hexapod", "--n", "10", "--candidates", "100", "--out", str(out), "--json"]
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 0, result.output
    found = read_any_poses(out, load_machine("hexapod"))
    assert len(found) == 10
    first = json.loads(result.stdout)["poses"][0]
    assert found[first["label"]] == pytest.approx(
        [first[k] for k in ("x", "y", "z", "rx", "ry", "rz")]
    )
