"""The tripod's own physics: laws, the home of docs/papers.md, and the engine beside it."""

import numpy as np
import pytest

from app.files.machines import load_machine
from calib.mechanism.solve import forward
from mocks.physics.parallelograms import settle, sides
from mocks.physics.pose import Array, Pose
from mocks.physics.tripod import LIMBS, geometry, positions, slider_places
from mocks.physics.truth import draw_parameters, machine_file, nominal_parameters

MACHINE = machine_file("tripod")
NO_LOAD = np.zeros((1, 6))


def strokes(count: int, seed: int) -> Array:
    return np.random.default_rng(seed).uniform(300.0, 425.0, (count, 3))


def test_home_of_the_notes() -> None:
    g = geometry(nominal_parameters(MACHINE))
    home = positions(g, np.full((1, 3), 410.0), g.h[None])
    assert home == pytest.approx(np.array([[0.0, 0.0, -np.sqrt(260.0**2 - 230.0**2)]]), abs=1e-10)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_forward_is_the_inverse_of_the_inverse(seed: int) -> None:
    g = geometry(draw_parameters(MACHINE, seed))
    places = strokes(200, seed)
    found = positions(g, places, np.tile(g.h, (200, 1)))
    assert slider_places(g, found) == pytest.approx(places, abs=1e-10)


def test_sides_that_do_not_meet_are_an_error() -> None:
    g = geometry(nominal_parameters(MACHINE))
    with pytest.raises(ArithmeticError, match="do not meet"):
        positions(g, np.full((1, 3), 600.0), g.h[None])


def test_equal_sides_leave_the_platform_parallel() -> None:
    g = geometry(draw_parameters(MACHINE, 4))
    places, h = strokes(50, 4), np.tile(g.h, (50, 1))
    start = Pose(positions(g, places, h), np.tile(np.eye(3), (50, 1, 1)))
    six = sides(g, places, h, np.zeros(3), np.zeros(3))
    rest = settle(six, start, 0.0, np.zeros((50, 6)))
    assert np.max(np.abs(rest.position - start.position)) < 1e-9
    assert np.max(np.abs(rest.rotation - np.eye(3))) < 1e-12


@pytest.mark.parametrize("limb", LIMBS)
def test_unequal_sides_and_azimuths_turn_it_as_the_engine_says(limb: str) -> None:
    """The engine closes two chains a limb with compliances; here are rods and hinge angles."""
    machine = load_machine("tripod").detailed
    assert machine is not None
    g = geometry(nominal_parameters(MACHINE))
    places, h = strokes(30, 5), np.tile(g.h, (30, 1))
    start = Pose(positions(g, places, h), np.tile(np.eye(3), (30, 1, 1)))
    one = np.array([float(name == limb) for name in LIMBS])
    for difference, azimuth, errors in (
        (0.1, 0.0, {f"{limb}.dh1": 0.05, f"{limb}.dh2": -0.05}),
        (0.0, 1e-3, {f"{limb}.dtheta_Bz": 1e-3}),
    ):
        six = sides(g, places, h, difference * one, azimuth * one)
        rest = settle(six, start, 0.0, np.zeros((30, 6)))
        found = forward(machine, places.T - 410.0, machine.vector(errors))
        moved = np.abs(rest.position - start.position).max()
        assert np.abs(found.poses.position.T - rest.position).max() < 2e-3 * moved
        turned = np.abs(rest.rotation - np.eye(3)).max()
        assert turned > 1e-4
        assert np.abs(found.poses.rotation.transpose(2, 0, 1) - rest.rotation).max() < 2e-3 * turned


def test_weight_at_home_lowers_the_platform_as_six_springs() -> None:
    """At home every rod carries a sixth of the weight over the sine of its inclination."""
    g = geometry(nominal_parameters(MACHINE))
    places, h = np.full((1, 3), 410.0), g.h[None]
    start = Pose(positions(g, places, h), np.eye(3)[None])
    weight, compliance = 100.0, 1e-5
    wrench = np.array([[0.0, 0.0, -weight, 0.0, 0.0, 0.0]])
    rest = settle(sides(g, places, h, np.zeros(3), np.zeros(3)), start, compliance, wrench)
    sine = -start.position[0, 2] / 260.0
    expected = -compliance * weight / (6.0 * sine**2)
    assert rest.position[0, 2] - start.position[0, 2] == pytest.approx(expected, rel=1e-4)
    assert np.abs(rest.rotation - np.eye(3)).max() < 1e-12
