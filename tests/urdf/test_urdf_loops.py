"""Parallel machines come from a URDF and a list of constraints, and go back as they are."""

from pathlib import Path

import numpy as np
import pytest

from app.cli import run
from app.files.machines import load_machine
from app.jobs.urdf import machine_of_urdf, urdf_of
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import forward
from calib.poses.reach import sample_poses
from tests.urdf import public_platform


def written(folder: Path, loops: str) -> tuple[Path, Path]:
    tree, listed = folder / "platform.urdf", folder / "loops.toml"
    tree.write_text(public_platform.platform_urdf())
    listed.write_text(loops)
    return tree, listed


def test_a_platform_stands_where_its_legs_closed_form_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree, listed = written(tmp_path, public_platform.platform_loops())
    out = tmp_path / "platform.toml"
    asked = ["machine", "import", str(tree), "--loops", str(listed), "--out", str(out)]
    assert run(asked) == 0
    # 6-UPS: 42 errors of joints and legs; a ball joint's are its centre's alone (Wang, Masory).
    assert "6 actuators" in capsys.readouterr().out
    machine = load_machine(str(out))
    at = sample_poses(machine, 10, np.random.default_rng(2))
    for k in range(10):
        place, turn = 1e-3 * at.poses.position[:, k], at.poses.rotation[:, :, k]
        assert np.allclose(1e-3 * at.q[:, k], public_platform.lengths(place, turn), atol=1e-11)


def came_back(machine: Machine, tmp_path: Path) -> tuple[Machine, np.ndarray]:
    draw = np.random.default_rng(7).standard_normal(len(machine.parameters))
    vector = machine.nominal + draw * machine.prior_sigma
    values = dict(zip((p.name for p in machine.parameters), map(float, vector), strict=True))
    (tmp_path / "back.urdf").write_text(urdf_of(machine, values, {}, "as calibrated"))
    return parse_machine(machine_of_urdf(tmp_path / "back.urdf"), "back.toml"), vector


@pytest.mark.parametrize("name", ["delta", pytest.param("stewart", marks=pytest.mark.long)])
def test_what_was_calibrated_goes_back_and_comes_in_again(name: str, tmp_path: Path) -> None:
    machine = load_machine(name)
    again, vector = came_back(machine, tmp_path)
    assert again.task == machine.task
    q = sample_poses(machine, 8, np.random.default_rng(1)).q
    there, back = forward(machine, machine.extension(q), vector), forward(again, again.extension(q))
    assert there.converged.all()
    assert back.converged.all()
    assert np.allclose(back.poses.position, there.poses.position, atol=1e-9)
    assert np.allclose(back.poses.rotation, there.poses.rotation, atol=1e-11)


def test_a_machine_that_closes_because_it_yields_has_no_urdf() -> None:
    with pytest.raises(BadInput, match="parts of them yield"):
        urdf_of(load_machine("tripod"), {}, {}, "")


FAULTS = {
    'actuated = ["slide1"': ('actuated = ["slyde1"', "which is no joint"),
    'platform = "plate"': ('platform = "rod9"', "no link"),
    'from = "rod2"': ('from = "tube1"', 'share the joint "foot1_x"'),
    'to = "plate"': ('to = "base"', "does not hang on"),
    'joint = "ball"': ('joint = "glue"', "ball"),
    '"slide6"]': ("]", "5 driven joints do not command a whole pose"),
    "slide2 = 0.": ("slide2 = 0.2", "does not close at home"),
}  # fmt: skip


@pytest.mark.parametrize("spoilt", FAULTS)
def test_what_cannot_be_closed_is_named(spoilt: str, tmp_path: Path) -> None:
    by, says = FAULTS[spoilt]
    loops = public_platform.platform_loops()
    assert spoilt in loops
    tree, listed = written(tmp_path, loops.replace(spoilt, by, 1))
    with pytest.raises(BadInput) as told:
        machine_of_urdf(tree, loops=listed)
    assert says in str(told.value)
