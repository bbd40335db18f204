"""The mock's closed form: numbers of docs/papers.md and the laws of kinematics."""

import numpy as np
import pytest

from mocks.physics.actuators import Load
from mocks.physics.hexapod import forward, geometry, home_pose, legs
from mocks.physics.hexapod_body import home_twist
from mocks.physics.hexapod_legs import axial_forces
from mocks.physics.pose import (
    Array,
    Pose,
    rotation_from_rpy,
    rotation_from_vector,
    rpy_from_rotation,
)
from mocks.physics.truth import draw_parameters, machine_file, nominal_parameters

MACHINE = machine_file("hexapod")
NOMINAL = geometry(nominal_parameters(MACHINE))


def random_poses(count: int, seed: int) -> Pose:
    rng = np.random.default_rng(seed)
    position = rng.uniform([-25, -25, 200], [25, 25, 240], (count, 3))
    angles = np.radians(rng.uniform([-15, -15, -20], [15, 15, 20], (count, 3)))
    return Pose(position, np.array([rotation_from_rpy(*a) for a in angles]))


def reachable_poses(count: int, seed: int) -> Pose:
    pose = random_poses(4 * count, seed)
    length = legs(NOMINAL, pose).length
    inside = np.flatnonzero(np.all((length > 195.0) & (length < 265.0), axis=1))[:count]
    return Pose(pose.position[inside], pose.rotation[inside])


def test_leg_length_at_home() -> None:
    assert legs(NOMINAL, home_pose(1)).length == pytest.approx(
        np.full((1, 6), 230.7148097226), abs=1e-9
    )


def test_arms_are_perpendicular_to_their_axes() -> None:
    found = legs(NOMINAL, random_poses(200, 1))
    assert np.max(np.abs(np.sum(found.u * found.second_base, axis=2))) < 1e-13
    assert np.max(np.abs(np.sum(found.u * found.second_platform, axis=2))) < 1e-13


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_forward_is_the_inverse_of_the_inverse(seed: int) -> None:
    g = geometry(draw_parameters(MACHINE, seed))
    pose = random_poses(300, seed)
    length = legs(g, pose).length
    found, _ = forward(g, lambda *_: length, home_pose(300))
    assert np.max(np.abs(found.position - pose.position)) < 1e-9
    assert np.max(np.abs(found.rotation - pose.rotation)) < 1e-11
    assert np.max(np.abs(legs(g, found).length - length)) < 1e-10


def test_rows_are_the_derivative_of_the_lengths() -> None:
    pose, h = random_poses(50, 4), 1e-5
    rows = legs(NOMINAL, pose).rows()

    def moved(direction: Array) -> Array:
        turn = rotation_from_vector(np.tile(direction[3:], (50, 1)))
        return legs(NOMINAL, Pose(pose.position + direction[:3], turn @ pose.rotation)).length

    for axis in range(6):
        step = h * np.eye(6)[axis]
        slope = (moved(step) - moved(-step)) / (2 * h)
        # a rotation of 1 rad moves joints by 120 mm: the scale of the second derivative
        assert np.max(np.abs(slope - rows[:, :, axis])) < 1e-6


def test_angles_and_rotations_are_inverse() -> None:
    rng = np.random.default_rng(5)
    angles = rng.uniform(-1.2, 1.2, (100, 3))
    rotation = np.array([rotation_from_rpy(*a) for a in angles])
    assert rpy_from_rotation(rotation) == pytest.approx(angles, abs=1e-12)


def test_axial_force_at_home_with_16_kg() -> None:
    found = legs(NOMINAL, home_pose(1))
    force = axial_forces(found, home_pose(1), Load(), np.array([8.0]))
    assert force == pytest.approx(np.full((1, 6), -28.655), abs=1e-3)


def test_axial_forces_are_in_equilibrium_with_the_weight() -> None:
    pose, load, payload = random_poses(100, 6), Load(), np.full(100, 5.0)
    found = legs(NOMINAL, pose)
    force = axial_forces(found, pose, load, payload)
    pull = -force[:, :, None] * found.u
    weight = (load.platform_mass_kg + 5.0) * np.asarray(load.gravity)
    assert np.max(np.abs(pull.sum(axis=1) + weight)) < 1e-9
    com = (8.0 * np.array(load.platform_com) + 5.0 * np.array(load.payload_com)) / 13.0
    moment = np.cross(found.arm, pull).sum(axis=1)
    moment += np.cross(pose.rotation @ com, weight)
    assert np.max(np.abs(moment)) < 1e-7


def test_twist_over_the_workspace() -> None:
    pose = reachable_poses(2000, 7)
    change = legs(NOMINAL, pose).twist() - home_twist(NOMINAL)
    change = (change + np.pi) % (2 * np.pi) - np.pi
    assert np.degrees(np.sqrt(np.mean(change**2))) == pytest.approx(9.0, abs=0.5)


def test_twist_of_2_mm_a_turn_moves_the_platform_by_79_um() -> None:
    pose = reachable_poses(2000, 8)
    found = legs(NOMINAL, pose)
    change = found.twist() - home_twist(NOMINAL)
    change = (change + np.pi) % (2 * np.pi) - np.pi
    bent = found.length + 2.0 / (2 * np.pi) * change
    moved, _ = forward(NOMINAL, lambda *_: bent, pose)
    rms = np.sqrt(np.mean(np.sum((moved.position - pose.position) ** 2, axis=1)))
    assert rms == pytest.approx(0.079, abs=0.005)


def test_legs_that_cannot_close_are_an_error() -> None:
    with pytest.raises((ArithmeticError, np.linalg.LinAlgError)):
        forward(NOMINAL, lambda found, _: np.array([[500.0, 10, 500, 10, 500, 10]]), home_pose(1))


def test_drawn_parameters_stay_within_tolerance_and_differ_by_seed() -> None:
    draws = [draw_parameters(MACHINE, seed) for seed in range(50)]
    off = np.array([[d[p.name] - p.nominal for p in MACHINE.parameters] for d in draws])
    assert np.all(np.abs(off) <= MACHINE.tolerance)
    spread = off.std(axis=0) / MACHINE.tolerance
    assert spread == pytest.approx(np.full(spread.size, 1 / np.sqrt(3)), abs=0.17)
    assert draw_parameters(MACHINE, 3) == draws[3]
