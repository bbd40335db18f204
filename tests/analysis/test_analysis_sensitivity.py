import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from app.files.machines import load_machine, shipped_machines
from app.verbs.sensitivity import command
from calib.analysis.coverage import workspace_poses
from calib.analysis.sensitivity import kind_of, local_indices, sensitivity, tolerances
from calib.mechanism.rigid import pose_difference
from calib.mechanism.solve import forward
from calib.mechanism.variants import with_closure

DEGREE = np.deg2rad(1.0)


@pytest.mark.parametrize("name", shipped_machines())
def test_local_index_is_how_far_a_small_error_moves_the_pose(name: str) -> None:
    machine = load_machine(name)
    poses = workspace_poses(machine, 10, np.random.default_rng(3)).take(np.arange(8))
    position, orientation = local_indices(poses)
    generator = np.random.default_rng(4)
    for k in generator.choice(len(machine.parameters), 6, replace=False):
        values = machine.nominal.copy()
        step = 1e-4 * machine.prior_sigma[k]
        values[k] += step
        moved = forward(machine, poses.configuration.extension, values, poses.configuration)
        twist = pose_difference(poses.poses, moved.poses) / step
        size = np.linalg.norm(twist[:3], axis=0), np.linalg.norm(twist[3:], axis=0)
        assert size[0] == pytest.approx(position[k], rel=1e-3, abs=1e-5)
        assert size[1] == pytest.approx(orientation[k], rel=1e-3, abs=1e-7)


def test_ptm_indices_of_zhang_over_217_poses() -> None:
    # LS, limbs 1 and 2, mm and deg per mm or deg.
    machine = with_closure(load_machine("ptm"), "LS")
    found = sensitivity(workspace_poses(machine, 1, np.random.default_rng(0)))
    assert found.poses == 217
    index = {i.name: i for i in found.parameters}
    expected = {
        "dtheta": (4.2430, 1.2095),
        "0dx1": (0.6404, 0.1790),
        "0da1": (1.0806, 0.3913),
        "4dz5": (0.8025, 0.2243),
        "6dx5": (0.6147, 0.1716),
    }
    for limb in ("limb1", "limb2"):
        for name, (position, orientation) in expected.items():
            held = index[f"{limb}.{name}"]
            unit = DEGREE if held.unit == "rad" else 1.0
            assert held.position * unit == pytest.approx(position, abs=2e-4)
            assert held.orientation * unit / DEGREE == pytest.approx(orientation, abs=2e-4)


def test_a_kind_is_the_root_of_the_sum_of_squares_over_limbs() -> None:
    machine = load_machine("stewart")
    poses = workspace_poses(machine, 40, np.random.default_rng(1))
    position, _ = local_indices(poses)
    held = [k for k, p in enumerate(machine.parameters) if kind_of(p.name) == "L0"]
    expected = np.mean(np.sqrt(np.sum(position[held] ** 2, axis=0)))
    found = {i.name: i for i in sensitivity(poses).kinds}
    assert found["L0"].position == pytest.approx(expected, rel=1e-12)


def test_tolerances_are_three_sigma_over_the_index() -> None:
    # Feng et al. 2022, section II D: T = +-3 x 20 / lambda.
    machine = load_machine("hexapod")
    found = sensitivity(workspace_poses(machine, 50, np.random.default_rng(1)))
    for tolerance, index in zip(tolerances(found, position=0.020), found.kinds, strict=True):
        assert tolerance.alone == pytest.approx(3.0 * 0.020 / index.position)
    # All kinds at the shared tolerance together cause what was wanted.
    shared = {t.kind: t.shared / 3.0 for t in tolerances(found, position=0.020)}
    total = np.sqrt(sum((shared[i.name] * i.position) ** 2 for i in found.kinds))
    assert total == pytest.approx(0.020)


def test_the_verb_answers_in_json_and_draws(tmp_path: Path) -> None:
    figure = tmp_path / "bars.png"
    arguments = [
        "hexapod",
        "--poses",
        "30",
        "--position-um",
        "20",
        "--figure",
        str(figure),
        "--json",
    ]
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert len(answer["parameters"]) == 54
    assert {kind["name"] for kind in answer["kinds"]} == {
        "B_x", "B_y", "B_z", "P_x", "P_y", "P_z", "L0", "L_B", "L_P",
    }  # fmt: skip
    assert figure.stat().st_size > 10_000
    shares = [p["position_share_mm"] for p in answer["parameters"]]
    assert shares == sorted(shares, reverse=True)
