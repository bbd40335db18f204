"""The tracking mechanism's own physics: numbers of docs/papers.md, laws, the engine beside it."""

from functools import cache

import numpy as np
import pytest

from app.files.machines import load_machine
from calib.mechanism.solve import forward
from calib.mechanism.variants import with_closure
from mocks.hidden.table import Hidden
from mocks.physics.actuators import Load
from mocks.physics.bodies import body_named
from mocks.physics.circumstances import Circumstances
from mocks.physics.pose import Array
from mocks.physics.ptm import geometry
from mocks.physics.ptm_body import EQUAL, PtmBody
from mocks.physics.ptm_closure import Stance, close
from mocks.physics.ptm_mirror import base_angles, normals, stance
from mocks.physics.truth import draw_parameters, machine_file

COUNT = 25


@cache
def motors() -> Array:
    """Motor angles of tilts up to 58 deg in all directions."""
    rng = np.random.default_rng(1)
    tilt = np.radians(rng.uniform(0.0, 58.0, COUNT))
    return base_angles(normals(tilt, rng.uniform(0.0, 2.0 * np.pi, COUNT)))[:, :2]


def closed(errors: dict[str, float], stiffness: Array = EQUAL) -> Stance:
    q = motors()
    return close(geometry(errors), lambda *_: q, np.ones(COUNT), stiffness, stance(q))


def test_angles_of_the_notes() -> None:
    found = base_angles(normals(np.radians([15.0]), np.radians([20.0])))
    psi = [61.84022, 54.43646, 39.09556, 46.10836]
    assert np.degrees(found[0]) + 50.64900 == pytest.approx(psi, abs=1e-5)


def test_without_errors_it_is_the_mirror_image() -> None:
    mirror, found = stance(motors()), closed({})
    assert np.abs(found.pose.position - mirror.pose.position).max() < 1e-9
    assert np.abs(found.pose.rotation - mirror.pose.rotation).max() < 1e-11
    assert np.abs(found.top - mirror.top).max() < 1e-11


def test_all_errors_together_as_the_engine_closes_them() -> None:
    machine = load_machine("ptm")
    errors = draw_parameters(machine_file("ptm"), 3, "normal")
    ours, theirs = closed(errors), forward(machine, motors().T, machine.vector(errors))
    assert np.abs(ours.pose.position.T - theirs.poses.position).max() < 1e-8
    assert np.abs(ours.pose.rotation.transpose(1, 2, 0) - theirs.poses.rotation).max() < 1e-10


@pytest.mark.parametrize("name", ["limb1.0da1", "limb2.6dz5", "limb3.3dz4", "limb5.1dx2"])
def test_large_single_errors_as_the_engine_closes_them(name: str) -> None:
    machine = load_machine("ptm")
    errors = {name: 0.01 if "da" in name else 1.0}
    ours, theirs = closed(errors), forward(machine, motors().T, machine.vector(errors))
    moved = np.abs(ours.pose.position - stance(motors()).pose.position).max()
    assert moved > 1e-3
    assert np.abs(ours.pose.position.T - theirs.poses.position).max() < 1e-3 * moved


@pytest.mark.parametrize("limb", [1, 2, 3, 4])
def test_released_limb_as_the_engine_releases_it(limb: int) -> None:
    machine = load_machine("ptm")
    errors = draw_parameters(machine_file("ptm"), 3, "normal")
    stiffness = EQUAL.copy()
    stiffness[limb - 1] = 0.0
    ours, whole = closed(errors, stiffness), closed(errors)
    theirs = forward(with_closure(machine, f"D{limb}"), motors().T, machine.vector(errors))
    moved = np.abs(ours.pose.position - whole.pose.position).max()
    assert moved > 0.01
    # The direction of the freed force is that of links without errors.
    assert np.abs(ours.pose.position.T - theirs.poses.position).max() < 0.02 * moved


def test_twist_of_the_motors_is_the_derivative_of_the_pose() -> None:
    g, q, h = geometry({}), motors(), 1e-5
    here = close(g, lambda *_: q, np.ones(COUNT), EQUAL, stance(q))
    for motor in range(2):
        there = q + h * np.eye(2)[motor]
        moved = close(g, lambda *_, at=there: at, np.ones(COUNT), EQUAL, here)
        slope = (moved.pose.position - here.pose.position) / h
        assert np.abs(slope - here.by_motor[:, :3, motor]).max() < 0.02


def test_controller_points_where_it_is_told() -> None:
    body = PtmBody()
    held = draw_parameters(body.machine, 6, "normal")
    poses = np.radians([[0.5, 10.0], [20.0, 100.0], [45.0, 200.0], [58.0, 300.0]])
    q = body.commanded(held, poses)
    found = close(geometry(held), lambda *_: q, np.ones(4), EQUAL, stance(q)).pose
    axis = found.rotation[:, :, 2]
    assert np.arccos(axis[:, 2]) == pytest.approx(poses[:, 0], abs=1e-9)
    azimuth = np.arctan2(axis[:, 1], axis[:, 0]) % (2.0 * np.pi)
    assert azimuth == pytest.approx(poses[:, 1], abs=1e-8)


def test_motors_yield_by_the_virtual_work_of_the_weight() -> None:
    """Symmetric load at home: no torque by symmetry of x and y; off centre: towards the load."""
    body = body_named("ptm")
    load = Load(platform_mass_kg=5.0, platform_com=(100.0, 0.0, 0.0))
    c = Circumstances(
        np.zeros((1, 2)), np.zeros((1, 2, 4)), np.zeros((1, 2)), np.full((1, 2), 1e3),
        np.full(1, 20.0), np.full(1, 20.0), np.zeros(1), lambda tau: np.zeros((1, 2)), np.zeros(1),
    )  # fmt: skip
    soft = body.real({}, Hidden({"gravity-sag.c": 1e-7}), load, False)
    axis = soft.poses(c, soft.home(1)).rotation[0, :, 2]
    assert axis[0] > 1e-4
    assert abs(axis[1]) < 0.05 * axis[0]


@pytest.mark.parametrize(
    "name", ["screw-twist.L", "backlash.limb3", "backlash.leg1", "joint-azimuth.limb1"]
)
def test_effects_that_it_does_not_have_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="has no hidden effect"):
        body_named("ptm").real({}, Hidden({name: 1.0}), Load(), False)


def test_limb_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="1, 2, 3 or 4"):
        body_named("ptm").real({}, Hidden({"redundancy.limb": 5.0}), Load(), False)
