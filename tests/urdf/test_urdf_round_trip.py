"""Two public arms come from URDF as their makers' formulas say, and go back as they are."""

from pathlib import Path

import numpy as np
import pytest

from app.cli import run
from app.files.urdf import angles_of, read_urdf, transform
from app.jobs.urdf import machine_of_urdf, urdf_of
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.check import require_sound
from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import forward
from tests.urdf import public_arms

ERRORS = {"ur5e": 18, "panda": 22}


@pytest.fixture(scope="module", params=["ur5e", "panda"])
def arm(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Machine:
    file = tmp_path_factory.mktemp("urdf") / f"{request.param}.urdf"
    file.write_text(public_arms.urdf_of(request.param))
    text = machine_of_urdf(file)
    machine = parse_machine(text, f"{request.param}.toml")
    require_sound(machine, text)
    return machine


def joints(machine: Machine, seed: int = 1) -> Array:
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (len(machine.actuators), 12))


def pose_in_urdf(text: str, q: Array) -> Array:
    """Tip (4, 4), m, of a URDF read joint by joint."""
    at, values = np.eye(4), iter(q)
    for one in read_urdf(text, "written").joints:
        at = at @ transform(one.xyz, one.rpy)
        if one.kind != "fixed":
            letter = "xyz"[int(np.argmax(np.abs(one.axis)))]
            at = at @ public_arms.turn(letter, float(one.axis.sum()) * next(values))
    return at


def test_an_arm_stands_where_its_makers_formulas_say(arm: Machine) -> None:
    q = joints(arm)
    found = forward(arm, q)
    for k in range(q.shape[1]):
        flange = public_arms.flange_of(arm.name, q[:, k])
        assert np.allclose(found.poses.position[:, k], 1000.0 * flange[:3, 3], atol=1e-8)
        assert np.allclose(found.poses.rotation[:, :, k], flange[:3, :3], atol=1e-12)


def test_errors_between_the_joints_are_as_many_as_the_theory_says(arm: Machine) -> None:
    """4 n + 6 of a chain of n turning joints (Everett et al. 1987), 6 of them the base's and 6
    the tool's."""
    assert len(arm.parameters) == ERRORS[arm.name] == 4 * len(arm.actuators) + 6 - 12


def test_what_was_calibrated_goes_back_and_comes_in_again(arm: Machine, tmp_path: Path) -> None:
    draw = np.random.default_rng(7).standard_normal(len(arm.parameters))
    values = dict(zip((p.name for p in arm.parameters), arm.nominal + draw * arm.prior_sigma,
                      strict=True))  # fmt: skip
    text = urdf_of(arm, values, {}, "as calibrated -- by a test")
    q = joints(arm, 2)
    found = forward(arm, q, arm.vector(values))
    for k in range(q.shape[1]):
        tip = pose_in_urdf(text, q[:, k])
        assert np.allclose(1000.0 * tip[:3, 3], found.poses.position[:, k], atol=1e-8)
        assert np.allclose(tip[:3, :3], found.poses.rotation[:, :, k], atol=1e-11)
    (tmp_path / "back.urdf").write_text(text)
    again = parse_machine(machine_of_urdf(tmp_path / "back.urdf"), "back.toml")
    assert np.allclose(forward(again, q).poses.position, found.poses.position, atol=1e-8)
    assert np.allclose(again.q_limits, arm.q_limits)


def test_axes_aside_slides_and_joints_that_follow_come_through(tmp_path: Path) -> None:
    text = public_arms.urdf_of("ur5e").replace('<axis xyz="0 0 1"/>', '<axis xyz="1 2 -2"/>', 1)
    text = text.replace('name="joint2" type="revolute"', 'name="joint2" type="continuous"')
    text = text.replace('name="flange" type="fixed"', 'name="flange" type="prismatic"')
    text = text.replace("</joint></robot>", '<mimic joint="joint3" multiplier="-0.5" offset="0.1"/>'
                        "</joint></robot>")  # fmt: skip
    (tmp_path / "odd.urdf").write_text(text)
    machine = parse_machine(machine_of_urdf(tmp_path / "odd.urdf"), "odd.toml")
    q = joints(machine)
    found = forward(machine, q).poses
    arm = read_urdf(text, "odd")
    for k in range(q.shape[1]):
        at, values = np.eye(4), list(q[:, k])
        for one in arm.joints:
            at = at @ transform(one.xyz, one.rpy)
            if one.mimic:
                at = at @ public_arms.shift(*(one.axis * (-0.5 * q[2, k] + 0.1)))
            elif one.kind != "fixed":
                at = at @ about(one.axis, values.pop(0))
        assert np.allclose(found.position[:, k], 1000.0 * at[:3, 3], atol=1e-8)
        assert np.allclose(found.rotation[:, :, k], at[:3, :3], atol=1e-11)


def about(axis: Array, angle: float) -> Array:
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    made = np.eye(4)
    made[:3, :3] += np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    return made


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-10, 1.0])
def test_angles_make_the_rotation_again(pitch: float) -> None:
    rotation = transform(np.zeros(3), np.array([0.3, pitch, -2.0]))[:3, :3]
    again = transform(np.zeros(3), angles_of(rotation))[:3, :3]
    assert np.allclose(again, rotation, atol=1e-9)


FAULTS = {
    "<robot": "not XML",
    '<model name="x"/>': "is no robot",
    '<robot name="x"/>': "no joint",
    '<robot><joint name="a" type="floating"/></robot>': "floating",
    '<robot><joint name="a" type="fixed"><parent link="p"/></joint></robot>': "no child",
    '<robot><joint name="a" type="revolute"><parent link="p"/><child link="c"/>'
    '<axis xyz="0 0 0"/></joint></robot>': "no direction",
    '<robot><joint name="a" type="revolute"><parent link="p"/><child link="c"/>'
    '<origin xyz="0 nan 0"/></joint></robot>': "not a finite",
    '<robot><joint name="a" type="revolute"><parent link="p"/><child link="c"/></joint>'
    '<joint name="b" type="revolute"><parent link="p"/><child link="d"/></joint></robot>': "2 ends",
    '<robot><joint name="a" type="fixed"><parent link="p"/><child link="c"/></joint></robot>':
    "nothing moves",
    '<robot><joint name="a" type="revolute"><parent link="p"/><child link="c"/></joint></robot>':
    "1 driven joints",
}  # fmt: skip


@pytest.mark.parametrize("text", FAULTS)
def test_what_cannot_be_taken_over_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.urdf").write_text(text)
    with pytest.raises(BadInput) as told:
        machine_of_urdf(tmp_path / "bad.urdf")
    assert FAULTS[text] in str(told.value)


def test_the_verbs_bring_an_arm_in_and_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "arm.urdf", tmp_path / "arm.toml"
    file.write_text(public_arms.urdf_of("ur5e"))
    assert run(["machine", "import", str(file), "--out", str(out)]) == 0
    assert "18 parameters" in capsys.readouterr().out
    assert run(["machine", "import", str(file), "--out", str(out)]) == 2
    assert run(["simulate", str(out), "--poses", "20", "--out", str(tmp_path / "run")]) == 0
    model = tmp_path / "model.toml"
    assert run(["fit", str(tmp_path / "run"), "--save", str(model)]) == 0
    capsys.readouterr()
    assert run(["export", str(model), "--as", "urdf"]) == 0
    assert len(read_urdf(capsys.readouterr().out, "out").joints) == 7
