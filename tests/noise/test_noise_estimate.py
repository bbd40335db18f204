"""Noise that is put into readings is found back with its size; where there is none, none is."""

import numpy as np
import pytest

from calib.evidence import LinearProblem
from calib.noise import Noise, Taking, estimate
from calib.noise.component import WHITE
from calib.noise.likelihood import Likelihood

VISITS, NESTS, UNKNOWNS = 60, 3, 25


def lab(noise: Noise, rng: np.random.Generator) -> tuple[LinearProblem, Taking]:
    """A fit with some unknowns to readings of three nests a visit with such noise."""
    count = VISITS * NESTS
    motions = rng.standard_normal((6, 3, count)) * 2.0
    visit = np.repeat(np.arange(VISITS), NESTS)
    taken = Taking(np.zeros(count, dtype=np.intp), 10.0 * np.arange(count), visit, motions)
    drawn = np.empty((3, count))
    rho = np.exp(-10.0 / noise.tau_s) if noise.tau_s else 0.0
    drawn[:, 0] = rng.standard_normal(3)
    for k in range(1, count):
        drawn[:, k] = rho * drawn[:, k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal(3)
    errors = noise.visit * rng.standard_normal((6, VISITS))[:, visit]
    read = (noise.scale * drawn + np.einsum("uik,uk->ik", motions, errors)).reshape(-1)
    jacobian = rng.standard_normal((UNKNOWNS, 3 * count))
    gone = np.linalg.lstsq(jacobian.T, read, rcond=None)[0]
    return LinearProblem(read - gone @ jacobian, jacobian, np.zeros(UNKNOWNS)), taken


@pytest.mark.parametrize(
    ("noise", "name", "value"),
    [
        (Noise(tau_s=14.0), "correlated", 14.0),
        (Noise(visit=0.3), "visit", 0.3),
        (Noise(scale=1.4), "scale", 1.4),
    ],
    ids=["correlated", "visit", "scale"],
)
def test_noise_is_found_back_with_its_size(noise, name, value):
    found = estimate(*lab(noise, np.random.default_rng(3)))
    first = found.components[0]
    assert [one.name for one in found.components if one.p_value < 1e-3] == [name]
    assert abs(first.value - value) < 4.0 * first.sigma
    assert first.sigma < 0.3 * value


def test_noise_does_not_hang_on_where_a_fit_has_stopped():
    """With loose priors a gradient that is small for the readings is large for the priors."""
    rng = np.random.default_rng(4)
    whole, taken = lab(Noise(scale=1.3), rng)
    loose = np.full(UNKNOWNS, 1e-4)
    moved = 0.05 * rng.standard_normal(UNKNOWNS) / np.sqrt(np.sum(whole.jacobian**2, axis=1))
    here = LinearProblem(whole.residual, whole.jacobian, loose, pull=np.zeros(UNKNOWNS))
    there = LinearProblem(
        whole.residual - moved @ whole.jacobian, whole.jacobian, loose, pull=loose * moved
    )
    for noise in (Noise(visit=0.5), Noise(tau_s=500.0, scale=30.0), Noise(scale=20.0, visit=10.0)):
        rises = [Likelihood(one, taken).of(noise) - Likelihood(one, taken).of(WHITE)
                 for one in (here, there)]  # fmt: skip
        assert rises[1] == pytest.approx(rises[0], rel=1e-9)


def test_what_priors_pull_with_goes_along_when_columns_join():
    rng = np.random.default_rng(5)
    whole, _ = lab(Noise(), rng)
    stiff = np.full(UNKNOWNS, 40.0)
    normal = whole.jacobian @ whole.jacobian.T + np.diag(stiff)
    read = whole.residual + rng.standard_normal(UNKNOWNS) @ whole.jacobian
    settled = np.linalg.solve(normal, whole.jacobian @ read)
    fit = LinearProblem(
        read - settled @ whole.jacobian, whole.jacobian, stiff, pull=stiff * settled
    )
    larger = fit.with_columns(rng.standard_normal((3, read.size)), np.full(3, 7.0))
    np.testing.assert_allclose(larger.held_back, larger.jacobian @ larger.residual, atol=1e-9)


def test_white_noise_is_taken_as_stated():
    clear = 0
    for seed in range(6):
        found = estimate(*lab(Noise(), np.random.default_rng(seed)))
        clear += any(one.p_value < 1e-3 for one in found.components)
    assert clear == 0
