import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from app.files.machines import load_machine
from app.verbs.iso9283 import command
from calib.analysis.iso9283 import (
    RP_OF_SIGMA,
    distance_result,
    implied_distance_repeatability,
    pose_result,
)
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.rigid import Poses
from calib.poses import sample_poses

NESTS = {"1": (0.0, 100.0, 0.0), "2": (86.6, -50.0, 0.0), "3": (-86.6, -50.0, 0.0)}
BASE = {"b1": (260.0, 0.0, -30.0), "b2": (-130.0, 225.0, -30.0), "b3": (-130.0, -225.0, -30.0)}
FRAME = Poses.from_xyz_rpy(np.array([[900.0, -700.0, 300.0, 0.1, -0.2, 0.7]]).T)

# Feng et al. 2022, Tables 5 to 8: AP_P, AP_x, AP_y, AP_z before and after calibration at P1..P5.
FENG_AP = np.array(
    [
        [1.1154, 0.35693, -0.98904, -0.3722, 0.41367, -0.06441, 0.40707, -0.03572],
        [1.3581, 0.61745, -1.1092, -0.4827, 0.40186, -0.01468, 0.38916, -0.09915],
        [1.2327, 0.14127, -1.1749, -0.3452, 0.31053, -0.05834, 0.28625, 0.10529],
        [0.96163, 0.08705, -0.91365, -0.28707, 0.42391, -0.11974, 0.40626, 0.01779],
        [1.0498, 0.57453, -0.79873, -0.3662, 0.59132, -0.08824, 0.5634, -0.15638],
    ]
)
FENG_RP = np.array(
    [
        [0.00969, 0.010445, 0.008529, 0.008663, 0.008364],
        [0.005516, 0.007261, 0.005415, 0.006182, 0.008164],
    ]
)
FENG_RD = np.array([0.49544, 0.14463])


def test_ap_and_rp_of_four_points_by_hand() -> None:
    # A square of side 2 around (1, 0, 0): every point sqrt(2) away, no spread of the distances.
    attained = np.array([[2.0, 2.0, 0.0, 0.0], [1.0, -1.0, 1.0, -1.0], [0.0, 0.0, 0.0, 0.0]])
    found = pose_result(np.array([0.0, 0.0, 2.0]), attained)
    assert found.accuracy_xyz == pytest.approx([1.0, 0.0, -2.0])
    assert found.accuracy == pytest.approx(np.sqrt(5.0))
    assert found.repeatability == pytest.approx(np.sqrt(2.0))


def test_rp_counts_three_standard_deviations_of_the_distances() -> None:
    attained = np.array([[-3.0, -1.0, 1.0, 3.0], [0.0] * 4, [0.0] * 4])
    # Distances 3, 1, 1, 3: mean 2, standard deviation sqrt(4/3) with n - 1.
    found = pose_result(np.zeros(3), attained)
    assert found.repeatability == pytest.approx(2.0 + 3.0 * np.sqrt(4.0 / 3.0))


def test_ad_and_rd_by_hand() -> None:
    first = np.zeros((3, 3))
    second = np.array([[10.0, 11.0, 12.0], [0.0] * 3, [0.0] * 3])
    found = distance_result((np.zeros(3), np.array([10.5, 0.0, 0.0])), (first, second))
    assert found.accuracy == pytest.approx(0.5)
    assert found.repeatability == pytest.approx(3.0)
    assert found.accuracy_xyz == pytest.approx([0.5, 0.0, 0.0])
    assert found.repeatability_xyz == pytest.approx([3.0, 0.0, 0.0])


def test_a_rigid_motion_changes_no_repeatability_and_no_distance() -> None:
    generator = np.random.default_rng(3)
    commands = generator.normal(size=(3, 2)) * 50.0
    attained = commands[:, None, :] + generator.normal(size=(3, 30, 2)) * 0.01
    R, t = FRAME.rotation[:, :, 0], FRAME.position[:, 0]

    def judged(c: Array, a: Array) -> tuple[float, ...]:
        pair = distance_result((c[:, 0], c[:, 1]), (a[:, :, 0], a[:, :, 1]))
        one = pose_result(c[:, 0], a[:, :, 0])
        return one.accuracy, one.repeatability, pair.accuracy, pair.repeatability

    moved = np.einsum("ij,jnk->ink", R, attained) + t[:, None, None]
    assert judged(R @ commands + t[:, None], moved) == pytest.approx(judged(commands, attained))


def test_scatter_of_sigma_one_has_rp_3_616_and_rd_3_sqrt_2() -> None:
    generator = np.random.default_rng(8)
    points = generator.standard_normal((3, 200_000))
    others = generator.standard_normal((3, 200_000)) + np.array([[500.0, 0.0, 0.0]]).T
    one = pose_result(np.zeros(3), points).repeatability
    assert one == pytest.approx(RP_OF_SIGMA, rel=5e-3)
    pair = distance_result((np.zeros(3), np.array([500.0, 0.0, 0.0])), (points, others))
    assert pair.repeatability == pytest.approx(3.0 * np.sqrt(2.0), rel=1e-2)
    assert pair.allowed == pytest.approx(pair.repeatability, rel=1e-2)


def test_angles_do_not_jump_at_180_deg() -> None:
    wanted = np.array([np.pi, 0.0, 0.0])
    reached = np.array([[np.pi - 0.01, -np.pi + 0.03], [0.0, 0.0], [0.0, 0.0]])
    found = pose_result(np.zeros(3), np.zeros((3, 2)), (wanted, reached))
    assert found.accuracy_angles == pytest.approx([0.01, 0.0, 0.0])
    assert found.repeatability_angles == pytest.approx([3.0 * 0.04 / np.sqrt(2.0), 0.0, 0.0])


def test_fengs_pose_accuracies_are_the_norms_of_their_components() -> None:
    for block in (FENG_AP[:, :4], FENG_AP[:, 4:]):
        norms = np.linalg.norm(block[:, 1:], axis=1)
        assert norms == pytest.approx(block[:, 0], abs=2e-3)
    assert FENG_AP[:, 4].max() == 0.59132
    assert FENG_RP[1].max() == 0.008164


def test_fengs_distance_repeatability_is_46_times_what_his_rp_allows() -> None:
    # docs/papers.md: it mixes poses, and is no repeatability of ISO 9283.
    allowed = [implied_distance_repeatability(rp.mean(), rp.mean()) for rp in FENG_RP]
    assert FENG_RD[0] / allowed[0] == pytest.approx(46.0, abs=0.5)
    assert FENG_RD[1] / allowed[1] > 15.0


def write_cycles(folder: Path, scatter: float, *, nests: int, breathing: float = 0.0) -> Poses:
    """A run of a hexapod: six poses, twelve cycles, offset (0.1, -0.2, 0.05) mm and 1 mrad."""
    machine = load_machine("hexapod")
    poses = sample_poses(machine, 6, np.random.default_rng(4))
    generator = np.random.default_rng(5)
    R, t = FRAME.rotation[:, :, 0], FRAME.position[:, 0]
    held = dict(list(NESTS.items())[:nests])
    middle = poses.poses.position.mean(axis=1)
    lines = ["time_s,pose,nest,q1,q2,q3,q4,q5,q6,x,y,z,sx,sy,sz,cycle"]

    def row(label: str, nest: str, q: Array, point: Array, cycle: str) -> None:
        seen = R @ point + t
        cells = [
            f"{len(lines)}",
            label,
            nest,
            *(f"{v:.9f}" for v in q),
            *(f"{v:.9f}" for v in seen),
        ]
        lines.append(",".join([*cells, "0.005", "0.005", "0.005", cycle]))

    for name, place in BASE.items():
        row("", name, poses.q[:, 0], np.array(place), "")
    for cycle in range(1, 13):
        for k in range(6):
            values = poses.poses.to_xyz_rpy()[:, k] + [0.1, -0.2, 0.05, 0.0, 0.0, 1e-3]
            values[:3] += scatter * generator.standard_normal(3)
            away = middle - poses.poses.position[:, k]
            values[:3] += breathing * (-1.0) ** cycle * away / np.linalg.norm(away)
            true = Poses.from_xyz_rpy(values[:, None])
            for nest, centre in held.items():
                point = true.points(np.array(centre)[:, None])[:, 0]
                row(f"P{k + 1}", nest, poses.q[:, k], point, str(cycle))
    text = ['format = "pkm-run/1"', 'machine = "hexapod"', "[nests.platform]"]
    text += [f'"{name}" = {list(centre)}' for name, centre in held.items()]
    text += ["[nests.base]", *(f"{name} = {list(place)}" for name, place in BASE.items())]
    folder.mkdir()
    (folder / "run.toml").write_text("\n".join(text) + "\n", encoding="utf-8")
    (folder / "points.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return poses.poses


def test_a_run_with_cycles_and_three_nests(tmp_path: Path) -> None:
    write_cycles(tmp_path / "run", 0.003, nests=3)
    result = CliRunner().invoke(command, [str(tmp_path / "run"), "--json"])
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert (answer["point"], answer["frame"]) == ("platform origin", "base nests")
    assert len(answer["poses"]) == 6
    for pose in answer["poses"]:
        assert pose["cycles"] == 12
        assert pose["AP_xyz_mm"] == pytest.approx([0.1, -0.2, 0.05], abs=0.004)
        assert pose["AP_angles_deg"] == pytest.approx([0.0, 0.0, np.rad2deg(1e-3)], abs=1e-5)
        assert pose["RP_mm"] == pytest.approx(0.003 * RP_OF_SIGMA, rel=0.5)
    for pair in answer["distances"]:
        assert abs(pair["AD_mm"]) < 0.004
        assert pair["RD_mm"] < 3.0 * pair["RD_expected_from_RP_mm"]


def test_one_nest_judges_its_centre_and_pairs_are_chosen(tmp_path: Path) -> None:
    write_cycles(tmp_path / "run", 0.003, nests=1)
    result = CliRunner().invoke(command, [str(tmp_path / "run"), "--pairs", "P2:P4", "--json"])
    answer = json.loads(result.stdout)
    assert answer["point"] == "nest 1"
    assert "AP_angles_deg" not in answer["poses"][0]
    assert [pair["pair"] for pair in answer["distances"]] == [["P2", "P4"]]


def test_poses_that_move_against_each_other_between_cycles_are_told(tmp_path: Path) -> None:
    write_cycles(tmp_path / "run", 1e-5, nests=3, breathing=0.01)
    words = CliRunner().invoke(command, [str(tmp_path / "run")])
    assert words.exit_code == 0, words.output
    assert "ISO 9283 asks for 30 cycles; the fewest here are 12." in words.stdout
    assert "scatter more than 3 times what the poses' own repeatability allows" in words.stdout


def test_bad_input_is_named(tmp_path: Path) -> None:
    write_cycles(tmp_path / "run", 0.003, nests=3)
    runner = CliRunner()
    with pytest.raises(BadInput, match="P1:P9"):
        runner.invoke(command, [str(tmp_path / "run"), "--pairs", "P1:P9"], catch_exceptions=False)
    with pytest.raises(BadInput, match='nest "7" was not read'):
        runner.invoke(command, [str(tmp_path / "run"), "--point", "7"], catch_exceptions=False)
    once = Path(__file__).parents[1] / "data" / "runs" / "no-effect"
    with pytest.raises(BadInput, match="two complete cycles"):
        runner.invoke(command, [str(once)], catch_exceptions=False)
