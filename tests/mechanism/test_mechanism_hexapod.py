"""The hexapod of Han et al. 2020 reaches the numbers that any correct program reaches."""

import numpy as np
import pytest

from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.limits import violations, within_limits
from calib.mechanism.rigid import Poses, pose_difference
from calib.mechanism.solve import forward, home_configuration, inverse
from tests.mechanism.conftest import load, manufactured, reachable


def closed_form_length(machine: Machine, pose: np.ndarray, leg: int) -> float:
    """Leg length by the closed equations (docs/papers.md), psi solved by Newton."""
    values = {p.name: p.nominal for p in machine.parameters}
    get = lambda key: values[f"leg{leg}.{key}"]  # noqa: E731
    phi_b = np.radians([15, 105, 135, 225, 255, 345][leg - 1])
    phi_p = np.radians([45, 75, 165, 195, 285, 315][leg - 1])
    turn = lambda a: np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])  # noqa: E731
    R = Poses.from_xyz_rpy(pose[:, None]).rotation[:, :, 0]
    FB, FP = turn(phi_b), turn(phi_p)
    B, P = np.array([get(f"B_{c}") for c in "xyz"]), np.array([get(f"P_{c}") for c in "xyz"])

    def arms(psi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n_B = FB[:, 1] * np.cos(psi[0]) + FB[:, 2] * np.sin(psi[0])
        n_P = FP[:, 1] * np.cos(psi[1]) + FP[:, 2] * np.sin(psi[1])
        v = pose[:3] + R @ (P + get("L_P") * n_P) - B - get("L_B") * n_B
        return n_B, n_P, v

    def residual(psi: np.ndarray) -> np.ndarray:
        n_B, n_P, v = arms(psi)
        return np.array([v @ np.cross(FB[:, 0], n_B), v @ (R @ np.cross(FP[:, 0], n_P))])

    psi = np.array([np.pi / 2, -np.pi / 2])
    for _ in range(30):
        slope = np.stack(
            [(residual(psi + h) - residual(psi - h)) / 2e-6 for h in np.eye(2) * 1e-6], axis=1
        )
        psi = psi - np.linalg.solve(slope, residual(psi))
    return float(np.linalg.norm(arms(psi)[2]))


def test_leg_length_at_220_mm(hexapod: Machine) -> None:
    found = inverse(hexapod, np.array([[0.0, 0, 220, 0, 0, 0]]).T)
    q = hexapod.coordinates(found.extension)[:, 0]
    assert q == pytest.approx(np.full(6, 230.7148097226), abs=1e-9)


@pytest.mark.long
def test_chain_gives_the_lengths_of_the_closed_equations(hexapod: Machine) -> None:
    configuration = reachable(hexapod, 10, seed=5)
    q = hexapod.coordinates(configuration.extension)
    poses = configuration.poses.to_xyz_rpy()
    for i in range(10):
        for leg in range(1, 7):
            assert closed_form_length(hexapod, poses[:, i], leg) == pytest.approx(
                q[leg - 1, i], abs=1e-9
            )


def test_two_thousand_poses_there_and_back(hexapod: Machine) -> None:
    start = reachable(hexapod, 2000, seed=6)
    there = forward(hexapod, start.extension)
    back = inverse(hexapod, there.poses)
    assert there.iterations.max() <= 6
    assert np.abs(back.extension - start.extension).max() < 1e-10
    assert np.abs(pose_difference(start.poses, there.poses)[:3]).max() < 1e-10
    assert np.abs(pose_difference(start.poses, there.poses)[3:]).max() < 1e-12


def test_a_third_to_a_half_of_the_box_is_reachable_and_no_corner(hexapod: Machine) -> None:
    rng = np.random.default_rng(7)
    low, high = np.array([hexapod.workspace[c] for c in hexapod.task.coordinates]).T
    values = low[:, None] + (high - low)[:, None] * rng.random((6, 3000))
    share = within_limits(hexapod, inverse(hexapod, values)).mean()
    assert share == pytest.approx(0.44, abs=0.03)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(6, 64)
    assert not within_limits(hexapod, inverse(hexapod, corners)).any()


def test_violations_name_the_actuator(hexapod: Machine) -> None:
    high = inverse(hexapod, np.array([[0.0, 0, 262, 0, 0, 0]]).T)
    found = violations(hexapod, high)
    assert [v.what for v in found] == ["q1", "q2", "q3", "q4", "q5", "q6"]
    assert all(v.value > v.high == 265.0 for v in found)


def test_length_derivatives_of_the_envelope_theorem(hexapod: Machine) -> None:
    """dl/dB = -u and d(residual)/dL0 = -1: moving B along the leg is shortening L0."""
    few = reachable(hexapod, 5, seed=8)
    J = pose_jacobians(hexapod, few)
    at = hexapod.index
    for leg in range(1, 7):
        L0 = J.parameters[at(f"leg{leg}.L0")]
        assert J.actuators[leg - 1] == pytest.approx(L0, abs=1e-12)
        B = J.parameters[[at(f"leg{leg}.B_{c}") for c in "xyz"]]
        along = [np.vdot(B[k], L0) / np.vdot(L0, L0) for k in range(3)]
        u = np.stack([np.sum(B[k] * L0, axis=0) / np.sum(L0**2, axis=0) for k in range(3)])
        assert np.sum(u**2, axis=0) == pytest.approx(np.ones(5), abs=1e-10)
        assert np.linalg.norm(along) <= 1.0 + 1e-12


def test_exact_ranks_over_poses(hexapod: Machine) -> None:
    """54 of 54 with known nests; a free base frame leaves 57 of 60 (docs/papers.md)."""
    configuration = reachable(hexapod, 40, seed=9)
    J = pose_jacobians(hexapod, configuration).parameters.reshape(54, -1).T
    assert np.linalg.matrix_rank(J, tol=1e-6 * np.linalg.norm(J, 2)) == 54


def test_manufactured_machine_misses_by_tenths_of_a_millimetre(hexapod: Machine) -> None:
    configuration = reachable(hexapod, 50, seed=10)
    built = forward(hexapod, configuration.extension, manufactured(hexapod, seed=11))
    miss = np.linalg.norm(pose_difference(configuration.poses, built.poses)[:3], axis=0)
    assert 0.05 < np.sqrt(np.mean(miss**2)) < 2.0


def test_home_is_the_same_machine_for_every_caller() -> None:
    machine = load("hexapod")
    assert home_configuration(machine) is home_configuration(machine)
