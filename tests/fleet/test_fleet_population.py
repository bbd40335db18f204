"""What a fleet teaches is true, and who is not like the others is found, rarely by chance."""

import numpy as np

from calib.analysis.population import family_wise, misfits, population
from calib.arrays import Array

SIZE = 8
PRIOR = np.geomspace(1e-4, 1.0, SIZE)
CENTRE = np.linspace(-3.0, 40.0, SIZE)


def fleet(count: int, spread: float, seed: int, off: float = 0.0) -> tuple[Array, Array, Array]:
    """Truths, estimates with the tolerances as priors and their covariances; machine 0 is off."""
    generator = np.random.default_rng(seed)
    columns = generator.standard_normal((SIZE, 3 * SIZE)) * np.geomspace(20.0, 0.2, SIZE)[:, None]
    usual = 0.4 * generator.standard_normal(SIZE)
    truth = usual + spread * generator.standard_normal((count, SIZE))
    truth[0, 1] += off
    covariance = np.linalg.inv(columns @ columns.T + np.eye(SIZE))
    read = truth @ columns + generator.standard_normal((count, 3 * SIZE))
    values = read @ columns.T @ covariance
    units = np.repeat((covariance * PRIOR * PRIOR[:, None])[None], count, axis=0)
    return CENTRE + PRIOR * truth, CENTRE + PRIOR * values, units


def named(chance: Array) -> bool:
    return family_wise(float(chance.min()), chance.size) < 0.05


def test_machines_of_a_narrow_fleet_are_known_better_than_each_alone() -> None:
    truth, values, covariance = fleet(60, 0.2, 1)
    found = population(values, covariance, CENTRE, PRIOR)
    assert np.std((found.values - truth) / PRIOR) < 0.8 * np.std((values - truth) / PRIOR)
    sigma = np.sqrt(np.einsum("kii->ki", found.covariance))
    assert 0.7 < np.std((found.values - truth) / sigma) < 1.1
    np.testing.assert_allclose(found.mean, truth.mean(axis=0), atol=0.2 * PRIOR.max())
    part = found.spread / PRIOR
    assert np.all(part > 0.15)
    assert np.all(part[:6] < 0.5)  # the readings hardly tell the last two


def test_a_fleet_as_wide_as_its_tolerances_has_them_as_spread() -> None:
    _, values, covariance = fleet(80, 1.0, 2)
    found = population(values, covariance, CENTRE, PRIOR)
    assert np.all(np.abs(found.spread / PRIOR - 1.0) < 0.4)


def test_no_machine_is_named_by_chance_more_often_than_said() -> None:
    count = 80
    false = sum(
        named(population(*fleet(7, 0.3, seed)[1:], CENTRE, PRIOR).chance) for seed in range(count)
    )
    assert false <= 0.05 * count + 3.0 * np.sqrt(0.05 * 0.95 * count)


def test_a_machine_that_is_off_is_named_with_its_parameter() -> None:
    _, values, covariance = fleet(30, 0.2, 3, off=5.0)
    found = population(values, covariance, CENTRE, PRIOR)
    assert named(found.chance)
    assert np.unravel_index(int(found.chance.argmin()), found.chance.shape) == (0, 1)
    others = population(values, covariance, CENTRE, PRIOR, np.arange(30) > 0)
    assert others.spread[1] < found.spread[1]


def test_units_do_not_matter_and_few_machines_name_none() -> None:
    _, values, covariance = fleet(3, 0.2, 4, off=9.0)
    found = population(values, covariance, CENTRE, PRIOR)
    assert np.all(found.chance == 1.0)
    scale = np.geomspace(1e-6, 1e6, SIZE)
    other = population(
        values * scale, covariance * scale * scale[:, None], CENTRE * scale, PRIOR * scale
    )
    np.testing.assert_allclose(other.values, found.values * scale, rtol=1e-6)


def test_one_that_is_explained_worse_is_named_and_none_where_all_are() -> None:
    generator = np.random.default_rng(5)
    dof = np.full(12, 250.0)
    chi2 = generator.chisquare(250.0, 12)
    assert not named(misfits(chi2, dof)[1])
    assert not named(misfits(9.0 * chi2, dof)[1])
    chi2[4] *= 2.0
    assert int(np.argmin(misfits(chi2, dof)[1])) == 4
    assert named(misfits(chi2, dof)[1])
