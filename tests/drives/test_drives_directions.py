"""Signs, nodes and counts that are wrong are found by small moves, before any large one."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from app.cli import run
from app.demo.station import mock_station
from app.files.machines import load_machine
from app.hosted.directions import SMALL_MM, complaints, displacements, small_ways
from calib.mechanism.description import Machine
from calib.mechanism.solve import inverse

SIGMA_MM = 0.01


@pytest.fixture(scope="module", params=["hexapod", "ptm", "tripod", "delta"])
def machine(request) -> Machine:
    return load_machine(request.param)


def moves(machine: Machine, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """How a nest should go and, with errors within tolerance and the tracker's, goes."""
    rng = np.random.default_rng(seed)
    extension = np.zeros(len(machine.actuators))
    nest = np.array([60.0, 80.0, -20.0])
    drawn = machine.nominal
    ways = small_ways(machine, drawn, extension, nest)
    half_widths = np.array([p.tolerance for p in machine.parameters])
    true = drawn + half_widths * rng.uniform(-1.0, 1.0, half_widths.size)
    seen = displacements(machine, true, extension, nest, ways)
    noise = SIGMA_MM / 3.0 * rng.normal(size=seen.shape)
    return displacements(machine, drawn, extension, nest, ways), seen + noise


def names(machine: Machine) -> list[str]:
    return [actuator.name for actuator in machine.actuators]


@pytest.mark.parametrize("seed", range(3))
def test_a_machine_within_its_tolerances_moves_as_drawn(machine: Machine, seed: int):
    drawn, seen = moves(machine, seed)
    wrong, _ = complaints(names(machine), drawn, seen, SIGMA_MM)
    assert wrong == []


def test_the_moves_are_small(machine: Machine):
    drawn, _ = moves(machine, 1)
    assert np.all(np.linalg.norm(drawn, axis=0) < 1.5 * SMALL_MM)


def test_whoever_moves_the_wrong_way_is_named(machine: Machine):
    drawn, seen = moves(machine, 4)
    for n, name in enumerate(names(machine)):
        flipped = seen.copy()
        flipped[:, n] *= -1.0
        wrong, _ = complaints(names(machine), drawn, flipped, SIGMA_MM)
        assert wrong == [f"{name} moves the wrong way: its sign"]


def test_two_that_are_exchanged_are_named():
    machine = load_machine("hexapod")
    drawn, seen = moves(machine, 5)
    exchanged = seen[:, [0, 3, 2, 1, 4, 5]]
    wrong, _ = complaints(names(machine), drawn, exchanged, SIGMA_MM)
    assert [line.split(":")[0] for line in wrong] == [
        "q2 moves the platform as q4 would",
        "q4 moves the platform as q2 would",
    ]


@pytest.mark.parametrize("factor", [0.5, 2.0, 25.4, -10.0])
def test_counts_that_are_wrong_are_told_with_their_factor(machine: Machine, factor: float):
    drawn, seen = moves(machine, 6)
    seen[:, 0] *= factor
    wrong, _ = complaints(names(machine), drawn, seen, SIGMA_MM)
    assert len(wrong) == 1
    said = float(wrong[0].split(" moves ")[1].split(" times")[0])
    assert said == pytest.approx(abs(factor), rel=0.2)
    assert ("wrong way" in wrong[0]) == (factor < 0.0)


def test_one_that_moves_nothing_and_one_that_cannot_be_seen():
    drawn = np.array([[1.0, 1e-3, np.nan], [0.0, 0.0, np.nan], [0.0, 0.0, np.nan]])
    seen = np.zeros((3, 3))
    wrong, unsaid = complaints(["a", "b", "c"], drawn, seen, SIGMA_MM)
    assert wrong == ["a does not move the platform (0.000 mm, drawn 1.000 mm)"]
    assert unsaid == ["b", "c"]


@pytest.mark.long
def test_a_flipped_sign_ends_a_session_before_its_first_large_move(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    machine = load_machine("hexapod")
    pose = (10.0, -8.0, 225.0, 0.1, 0.05, -0.1)
    poses = tmp_path / "poses.csv"
    poses.write_text("pose,x,y,z,rx,ry,rz\n1," + ",".join(map(repr, pose)) + "\n", encoding="utf-8")
    assert inverse(machine, np.array(pose)[:, None]).converged[0]
    with mock_station("hexapod", 5, 600.0, tmp_path, ["--bare"]) as site:
        said = tomllib.loads(site.read_text(encoding="utf-8"))
        said["controller"]["sign"][2] = -1.0
        site.write_text(tomli_w.dumps(said), encoding="utf-8")
        words = ["measure", "--site", str(site), "--poses", str(poses), "--unattended"]
        code = run([*words, "--no-warm-up", "--folder", str(tmp_path / "sessions")])
    told = capsys.readouterr()
    assert code == 3
    assert "q3 moves the wrong way: its sign" in told.err
    assert "at pose 1" not in told.out + told.err
