"""The tripod: every number that a correct implementation reaches (Feng et al.)."""

from functools import lru_cache
from importlib.resources import files

import numpy as np
import pytest

from app.reproduce.pose_fit import fit_poses
from app.reproduce.tripod_formulas import (
    AZIMUTH,
    SOURCES,
    B,
    C,
    H,
    elastic_map,
    limb,
    side_row,
    slider,
)
from calib.arrays import Array, Numbers
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.rigid import exponential
from calib.mechanism.solve import Configuration, forward, inverse

POSITION_ONLY = np.array([0.01, 0.01, 0.01, np.inf, np.inf, np.inf])
NINE = [f"limb{i}.{name}" for i in (1, 2, 3) for name in ("l0", "h", "theta")]


@lru_cache
def machine() -> Machine:
    text = files("calib.machines").joinpath("tripod.toml").read_text()
    return parse_machine(text, "tripod.toml")


def detailed() -> Machine:
    found = machine().detailed
    assert found is not None
    return found


def at_sliders(q: Array, parameters: Array | None = None) -> Configuration:
    found = forward(machine(), machine().extension(q), parameters)
    assert found.converged.all()
    return found


def grid(low: float, high: float, count: int = 3) -> Array:
    axis = np.linspace(low, high, count)
    return np.array(np.meshgrid(axis, axis, axis)).reshape(3, -1)


def test_nine_parameters_and_45_error_sources() -> None:
    assert [p.name for p in machine().parameters] == NINE
    hidden = [p.name for p in detailed().parameters if p.hidden]
    assert hidden == [f"limb{i}.{name}" for i in (1, 2, 3) for name in SOURCES]
    assert len(hidden) == 45


def test_sliders_as_in_equation_3() -> None:
    rng = np.random.default_rng(1)
    r = at_sliders(rng.uniform(280, 430, (3, 200))).poses.position
    found = inverse(machine(), r)
    assert found.converged.all()
    assert np.abs(machine().coordinates(found.extension) - slider(r)).max() < 1e-10
    assert np.abs(forward(machine(), found.extension).poses.position - r).max() < 1e-10


def test_the_platform_does_not_turn() -> None:
    poses = at_sliders(grid(280, 430)).poses
    assert np.abs(poses.rotation - np.eye(3)[:, :, None]).max() < 1e-12


def gauss_nodes(count: int) -> tuple[Array, Array]:
    """Sliders (3, M) and weights (M,) that integrate over 280..430 in each of them."""
    x, w = np.polynomial.legendre.leggauss(count)
    x, w = 355.0 + 75.0 * x, 75.0 * w
    nodes = np.array(np.meshgrid(x, x, x, indexing="ij")).reshape(3, -1)
    return nodes, np.einsum("i,j,k->ijk", w, w, w).ravel()


def volume_weights(found: Configuration, weights: Array) -> Array:
    moves = pose_jacobians(machine(), found).actuators[:, :3]
    return weights * np.abs(np.linalg.det(np.moveaxis(moves, -1, 0)))


@pytest.mark.long
def test_workspace() -> None:
    nodes, weights = gauss_nodes(14)
    assert volume_weights(at_sliders(nodes), weights).sum() == pytest.approx(1.30090e6, rel=1e-4)
    r = at_sliders(grid(280, 430, 31)).poses.position
    assert [r[0].min(), r[0].max()] == pytest.approx([-116.667, 87.5], abs=1e-3)
    assert [r[1].min(), r[1].max()] == pytest.approx([-101.0363, 101.0363], abs=1e-3)
    assert [r[2].min(), r[2].max()] == pytest.approx([-240.0, -71.4143], abs=1e-3)


def side_length(i: int, j: int, r: Array, twist: Numbers, errors: Numbers) -> Numbers:
    """Exact length of a long side with errors of one limb and a small motion of the platform."""
    length, o, _, R = limb(i, r)
    sign = -0.5 if j == 0 else 0.5
    e1 = np.array([1.0, 0.0, 0.0])
    short = R @ exponential(errors[6:9]) @ (sign * (C + errors[3]) * e1)
    a = exponential(errors[9:12]) @ (length * o + R @ errors[:3] + short)
    b = r + twist[:3] + exponential(twist[3:]) @ exponential(errors[12:15]) @ ((B + sign * C) * o)
    gap = b - a
    return np.sqrt(gap @ gap) - errors[4 + j]


def test_coefficients_against_the_exact_sides() -> None:
    """Of equation (6), of which (7) is the difference and (9) the mean."""
    r = np.array([12.0, -25.0, -130.0])
    for i in range(3):
        for j in range(2):
            row, sources = side_row(i, j, r)
            assert side_length(i, j, r, np.zeros(6), np.zeros(15)) == pytest.approx(H, abs=1e-9)
            steps = 1e-30j * np.eye(15)
            exact = [np.imag(side_length(i, j, r, np.zeros(6), s)) / 1e-30 for s in steps]
            assert -np.array(exact) == pytest.approx(sources, abs=1e-9 * H)
            steps = 1e-30j * np.eye(6)
            exact = [np.imag(side_length(i, j, r, s, np.zeros(15))) / 1e-30 for s in steps]
            assert np.array(exact) == pytest.approx(row, abs=1e-9 * H)


@pytest.mark.parametrize("sliders", [(410, 410, 410), (300, 380, 425), (430, 290, 350)])
def test_elastic_closure_against_the_linear_map(sliders: tuple[float, float, float]) -> None:
    found = at_sliders(np.array(sliders, dtype=float)[:, None])
    engine = pose_jacobians(detailed(), found).parameters[9:, :, 0].T
    closed = elastic_map(found.poses.position[:, 0], 0.01)
    assert np.abs(engine - closed).max(axis=1) / np.abs(closed).max(axis=1) == pytest.approx(
        np.zeros(6), abs=1e-6
    )


def test_volume_averages_of_the_sensitivities() -> None:
    """Frobenius norms over the three limbs, hinges much softer than the sides."""
    nodes, weights = gauss_nodes(7)
    found = at_sliders(nodes)
    weights = volume_weights(found, weights)
    maps = np.stack([elastic_map(r, 1e-9, plain=False) for r in found.poses.position.T])
    maps = maps.reshape(-1, 6, 3, 15)

    def average(source: str, part: slice) -> float:
        norms = np.linalg.norm(maps[:, part, :, SOURCES.index(source)], axis=(1, 2))
        return float(norms @ weights / weights.sum())

    assert C * average("dh1", slice(3, 6)) == pytest.approx(1.6914, rel=0.005)
    assert average("dh1", slice(0, 3)) == pytest.approx(3.006, rel=0.005)
    assert average("dtheta_Ax", slice(0, 3)) == pytest.approx(213.63, rel=0.001)


def test_noise_free_recovery() -> None:
    rng = np.random.default_rng(3)
    built = machine().nominal + machine().tolerance * rng.uniform(-1, 1, 9)
    q = grid(330, 430)
    fit = fit_poses(machine(), at_sliders(q), at_sliders(q, built).poses, POSITION_ONLY)
    assert fit.values == pytest.approx(built, abs=1e-8)


def spread(q: Array) -> Array:
    """Standard deviations of l0 (mm), h (mm), theta (rad) for 10 um: RMS over the limbs."""
    columns = pose_jacobians(machine(), at_sliders(q)).parameters[:, :3].reshape(9, -1) / 0.010
    sigma = np.sqrt(np.diag(np.linalg.inv(columns @ columns.T))).reshape(3, 3)
    rms: Array = np.sqrt(np.mean(sigma**2, axis=0))
    return rms


def spread_of_the_papers_fit(q: Array) -> Array:
    """The same for unweighted least squares on the sliders' places, equation (18)."""
    r = at_sliders(q).poses.position
    steps = 1e-4 * np.eye(3)[:, :, None]
    answers = np.stack([(slider(r + s) - slider(r - s)) / 2e-4 for s in steps])
    sigma = []
    for i in range(3):
        cos, sin = np.cos(AZIMUTH[i]), np.sin(AZIMUTH[i])
        t, q_i = r[0] * sin - r[1] * cos, r[0] * cos + r[1] * sin
        s = np.sqrt(H**2 - r[2] ** 2 - t**2)
        columns = np.stack([-np.ones_like(t), H / s, -t - t * q_i / s])
        inverse_columns = np.linalg.pinv(columns.T)
        noise = 0.010 * np.linalg.norm(answers[:, i], axis=0)
        sigma.append(np.sum((inverse_columns * noise) ** 2, axis=1))
    rms: Array = np.sqrt(np.mean(sigma, axis=0))
    return rms


def test_what_27_poses_tell() -> None:
    l0, h, theta = spread_of_the_papers_fit(grid(280, 430))
    assert l0 == pytest.approx(0.016, rel=0.2)
    assert h == pytest.approx(0.011, rel=0.2)
    assert np.degrees(theta) == pytest.approx(0.0030, rel=0.2)
    assert np.all(spread(grid(280, 430)) < [l0, h, theta])


def test_slider_range_matters_more_than_the_number_of_poses() -> None:
    assert spread_of_the_papers_fit(grid(405, 415))[1] == pytest.approx(0.194, rel=0.2)


def test_ranks() -> None:
    """Positions only; b_i = l0_i, and the frame's yaw = common theta."""
    found = at_sliders(grid(280, 430, 4))
    r = found.poses.position
    own = pose_jacobians(machine(), found).parameters[:, :3]
    hidden = pose_jacobians(detailed(), found).parameters[:, :3]

    def source(name: str) -> Array:
        return np.stack([hidden[detailed().index(f"limb{i}.{name}")] for i in (1, 2, 3)])

    shift = np.repeat(np.eye(3)[:, :, None], r.shape[1], axis=2)
    turn = np.stack([np.cross(axis, r.T).T for axis in np.eye(3)])

    def rank(*parts: Array) -> tuple[int, int]:
        columns = np.concatenate(parts)
        columns = columns.reshape(len(columns), -1)
        columns = columns / np.linalg.norm(columns, axis=1)[:, None]
        values = np.linalg.svd(columns, compute_uv=False)
        return int(np.count_nonzero(values > 1e-9 * values[0])), len(columns)

    b = [source("de1x"), source("de1y"), source("de1z")]
    assert rank(own) == (9, 9)
    assert rank(own, b[0]) == (9, 12)
    assert rank(own, turn[2:]) == (9, 10)
    assert rank(own, *b, turn, shift) == (17, 24)


def test_theta_turns_slider_and_platform_joint_alike() -> None:
    found = at_sliders(np.array([[300.0], [380.0], [425.0]]))
    columns = pose_jacobians(detailed(), found).parameters
    index = detailed().index
    both = columns[index("limb2.dtheta_Az")] + columns[index("limb2.dtheta_Bz")]
    assert columns[index("limb2.theta")] == pytest.approx(both, abs=1e-9)
    assert AZIMUTH[1] == pytest.approx(machine().nominal[index("limb2.theta")])


def test_sides_of_unequal_length_turn_the_platform() -> None:
    found = at_sliders(np.array([[410.0], [410.0], [410.0]]))
    errors = detailed().vector({"limb1.dh1": 0.01, "limb1.dh2": -0.01})
    moved = forward(detailed(), found.extension, errors).poses
    assert np.abs(moved.rotation[:, :, 0] - np.eye(3)).max() > 1e-5
    assert np.abs(moved.position - found.poses.position).max() < 0.05
