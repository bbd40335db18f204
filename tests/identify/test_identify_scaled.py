"""Normal equations in many units: scaled, solved and scaled back."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.scaled import Scaled, normal_matrix

UNITS = 10.0 ** np.array([-8, -3, 0, 4, 9])


@pytest.fixture(params=range(4))
def equations(request: pytest.FixtureRequest) -> tuple[Array, Array, Array]:
    """Derivatives, precision and slope of five unknowns whose units are 17 decades apart."""
    rng = np.random.default_rng(request.param)
    columns = UNITS[:, None] * rng.standard_normal((5, 40))
    return columns, UNITS**2 * rng.uniform(0.0, 1.0, 5), UNITS * rng.standard_normal(5)


def test_solution_solves(equations: tuple[Array, Array, Array]) -> None:
    columns, precision, slope = equations
    normal = normal_matrix(columns, precision)
    back = normal @ Scaled.of(normal).solve(slope)
    np.testing.assert_allclose(back / UNITS, slope / UNITS, rtol=1e-9, atol=1e-9)


def test_inverse_and_half_agree_with_the_solution(equations: tuple[Array, Array, Array]) -> None:
    columns, precision, slope = equations
    scaled = Scaled.of(normal_matrix(columns, precision))
    solved = scaled.solve(slope)
    np.testing.assert_allclose(scaled.inverse() @ slope, solved, rtol=1e-8)
    half = scaled.half_solved(slope)
    np.testing.assert_allclose(half @ half, slope @ solved, rtol=1e-9)
    both = scaled.half_solved(np.stack([slope, 2.0 * slope], axis=1))
    np.testing.assert_allclose(both, np.stack([half, 2.0 * half], axis=1), rtol=1e-9)


def test_units_do_not_matter(equations: tuple[Array, Array, Array]) -> None:
    columns, precision, slope = equations
    plain = Scaled.of(normal_matrix(columns / UNITS[:, None], precision / UNITS**2))
    scaled = Scaled.of(normal_matrix(columns, precision))
    for damping in (0.0, 0.3):
        np.testing.assert_allclose(
            scaled.solve(slope, damping) * UNITS, plain.solve(slope / UNITS, damping), rtol=1e-9
        )


def test_damping_shortens(equations: tuple[Array, Array, Array]) -> None:
    columns, precision, slope = equations
    scaled = Scaled.of(normal_matrix(columns, precision))
    lengths = [np.linalg.norm(scaled.solve(slope, d) / scaled.scale) for d in (0.0, 0.1, 10.0)]
    assert lengths[0] > lengths[1] > lengths[2]


def test_unknown_that_nothing_determines() -> None:
    columns = np.array([[1.0, 2.0], [0.0, 0.0]])
    scaled = Scaled.of(normal_matrix(columns, np.zeros(2)), least=1e-12)
    np.testing.assert_allclose(scaled.solve(np.array([5.0, 0.0])), [1.0, 0.0], atol=1e-11)
