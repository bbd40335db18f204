import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from app.files.machines import load_machine, shipped_machines
from app.machine_templates import TEMPLATES
from app.show.braille import Canvas
from app.verbs.machine import command
from calib.analysis.inspection import inspect
from calib.analysis.skeleton import skeleton
from calib.errors import BadInput
from calib.mechanism.solve import home_configuration
from calib.poses import sample_poses

KINDS = [template.name for template in TEMPLATES]


@pytest.mark.parametrize("name", shipped_machines())
def test_every_limb_of_the_skeleton_ends_at_the_platform(name: str) -> None:
    machine = load_machine(name)
    poses = sample_poses(machine, 3, np.random.default_rng(2))
    for pose in range(3):
        drawn = skeleton(machine, poses.configuration, pose)
        for limb in drawn.limbs:
            assert limb.corners[:, -1] == pytest.approx(drawn.position, abs=1e-6)
            assert limb.corners[:, 0] == pytest.approx(np.zeros(3), abs=1e-12)
            assert all(np.linalg.norm(j.axis) == pytest.approx(1.0) for j in limb.joints)
        driven = {j.name for limb in drawn.limbs for j in limb.joints if j.driven}
        assert driven == {a.name for a in machine.actuators}


def test_hexapod_skeleton_has_legs_of_the_commanded_length() -> None:
    machine = load_machine("hexapod")
    home = home_configuration(machine)
    for limb in skeleton(machine, home).limbs:
        places = {j.name: j.place for j in limb.joints}
        length = np.linalg.norm(places["swing_P"] - places["twist"])
        assert length == pytest.approx(230.715, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "redundant", "mobility", "rank"),
    [("hexapod", 0, 6, 54), ("stewart", 0, 6, 42), ("ptm", 1, 2, 55), ("tripod", 6, 3, 9)],
)
def test_inspection_numbers(name: str, redundant: int, mobility: int, rank: int) -> None:
    found = inspect(load_machine(name), np.random.default_rng(1))
    assert (found.redundant, found.mobility, found.rank) == (redundant, mobility, rank)
    assert found.freedoms_held == 6
    assert found.home_gap_mm < 1e-3


def test_hexapod_reach_of_the_box_of_table_3() -> None:
    # docs/papers.md: 44 % of random poses of Table 3's box are reachable.
    found = inspect(load_machine("hexapod"), np.random.default_rng(1))
    assert found.reach == pytest.approx(0.44, abs=0.04)
    assert {stop.what for stop in found.stops} == {f"q{i}" for i in range(1, 7)}
    low, high = found.used["q1"]
    assert 195.0 <= low < 205.0
    assert 255.0 < high <= 265.0


def test_check_in_words_and_json() -> None:
    runner = CliRunner()
    words = runner.invoke(command, ["check", "ptm"])
    assert words.exit_code == 0, words.output
    assert "limb1, limb2: [R]RRRR" in words.stdout
    assert "Over-constrained: 1 constraint more than needed" in words.stdout
    assert "55 independent combinations of 83" in words.stdout
    found = json.loads(runner.invoke(command, ["check", "hexapod", "--json"]).stdout)
    assert (found["rank"], found["parameters"], found["redundant"]) == (54, 54, 0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_machine_closes_and_reaches(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    result = CliRunner().invoke(command, ["new", str(file), "--kind", kind, "--yes"])
    assert result.exit_code == 0, result.output
    assert "It closes" in result.stdout
    machine = load_machine(str(file))
    assert sample_poses(machine, 20, np.random.default_rng(1)).count == 20
    assert "# " in file.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("hexapod", ["base_radius=180", "platform_radius=120", "height=220", "stroke=70"]),
        ("hexapod", ["base_gap=50", "platform_gap=10"]),
        ("delta", ["tower_radius=200", "rod_length=350", "height=0"]),
        ("arm", ["upper_arm=900", "lower_arm=800", "flange=200"]),
        ("own", ["limbs=4", "joints=Ry(-14.9d) Rz Tz:q+L0 ball=Sxyz", "task=z rx ry rz"]),
    ],
)
def test_a_new_machine_with_other_sizes(kind: str, settings: list[str], tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    options = [word for setting in settings for word in ("--set", setting)]
    result = CliRunner().invoke(command, ["new", str(file), "--kind", kind, "--yes", *options])
    assert result.exit_code == 0, result.output
    if kind == "own":
        # Four of these legs hold only four freedoms: the file is written and its fault is told.
        assert "It does not work yet" in result.stdout
        assert "mine.toml" in result.stdout
    else:
        assert "It closes" in result.stdout, result.stdout


def test_a_person_is_asked(tmp_path: Path) -> None:
    file = tmp_path / "asked.toml"
    answers = "hexapod\n250\n150\n\n\n300\n\n0.1\n"
    result = CliRunner().invoke(command, ["new", str(file)], input=answers)
    assert result.exit_code == 0, result.output
    machine = load_machine(str(file))
    assert machine.home[2] == 300.0
    assert machine.tolerance[0] == pytest.approx(0.1)
    radius = np.hypot(*(machine.nominal[machine.index(f"leg1.{k}")] for k in ("B_x", "B_y")))
    assert radius == pytest.approx(250.0, abs=1e-5)


def test_new_never_overwrites_and_names_unknown_settings(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("mine", encoding="utf-8")
    with pytest.raises(BadInput, match="such a file already"):
        CliRunner().invoke(
            command, ["new", str(file), "--kind", "arm", "--yes"], catch_exceptions=False
        )
    assert file.read_text(encoding="utf-8") == "mine"
    with pytest.raises(BadInput, match="nobody asked"):
        CliRunner().invoke(
            command,
            ["new", str(tmp_path / "b.toml"), "--kind", "arm", "--yes", "--set", "lenght=3"],
            catch_exceptions=False,
        )


@pytest.mark.parametrize("name", shipped_machines())
def test_machines_are_drawn(name: str, tmp_path: Path) -> None:
    runner = CliRunner()
    text = runner.invoke(command, ["draw", name], env={"COLUMNS": "80", "LINES": "24"})
    assert text.exit_code == 0, text.output
    assert max(len(line) for line in text.stdout.splitlines()) <= 80
    assert sum(ch > "\u2800" for ch in text.stdout) > 60
    figure = tmp_path / "machine.svg"
    assert runner.invoke(command, ["draw", name, "--out", str(figure)]).exit_code == 0
    assert "<svg" in figure.read_text(encoding="utf-8")


def test_drawing_at_a_pose_and_refusing_a_wrong_one() -> None:
    runner = CliRunner()
    drawn = runner.invoke(command, ["draw", "hexapod", "--at", "x=5 rz=3deg"])
    assert "platform at 5.00, 0.00, 220.00 mm; rx, ry, rz 0.00, 0.00, 3.00 deg" in drawn.stdout
    with pytest.raises(BadInput, match="tilt=3"):
        runner.invoke(command, ["draw", "hexapod", "--at", "tilt=3"], catch_exceptions=False)


def test_canvas_keeps_equal_lengths_equal() -> None:
    canvas = Canvas(20, 10, np.array([0.0, 0.0]), np.array([1.0, 1.0]))
    canvas.line(np.array([0.0, 0.0]), np.array([1.0, 0.0]))
    across = int(canvas.dots.sum())
    canvas.dots[:] = False
    canvas.line(np.array([0.0, 0.0]), np.array([0.0, 1.0]))
    assert abs(int(canvas.dots.sum()) - across) <= 1
    canvas.dot(np.array([1e6, -1e6]))
    assert len(canvas.lines()) == 10
    assert all(len(line) == 20 for line in canvas.lines())
