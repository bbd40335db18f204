"""Innovations are what a dense Cholesky factor of the covariance would make of the readings."""

from dataclasses import replace

import numpy as np
import pytest

from calib.mechanism import kernel
from calib.noise import Noise, Scatter, Taking, Whitening
from calib.noise.filtering import compiled, in_one_pass

READINGS, ACTUATORS = 30, 4
CASES = [
    Noise(scale=1.3),
    Noise(tau_s=20.0),
    Noise(tau_s=20.0, share=0.6, scale=1.2),
    Noise(tau_s=20.0, by_row=True),
    Noise(visit=0.5, scale=0.9),
    Noise(visit=0.5, tau_s=30.0),
    Noise(visit=0.5, tau_s=30.0, share=0.5, by_row=True),
]


def taking(rng: np.random.Generator) -> Taking:
    """Two runs; visits of three readings, base nests among them; in any order."""
    run = np.repeat([0, 1], READINGS // 2)
    time = np.concatenate([np.sort(rng.uniform(0, 300, READINGS // 2)) for _ in range(2)])
    time[4] = time[3]
    visit = np.repeat(np.arange(READINGS // 3), 3)
    visit[[0, 10, 17]] = -1
    mixed = rng.permutation(READINGS)
    motions = rng.standard_normal((ACTUATORS, 3, READINGS))
    return Taking(run[mixed], time[mixed], visit[mixed], motions)


def covariance(taken: Taking, noise: Noise) -> np.ndarray:
    """The whole covariance (3 A, 3 A), written out."""
    alike = np.eye(READINGS)
    if noise.tau_s:
        clock = np.zeros(READINGS)
        gaps = taken.gaps(noise.by_row)
        clock[taken.order] = np.cumsum(np.where(np.isfinite(gaps), gaps, 0.0))
        same_run = taken.run[:, None] == taken.run
        fading = np.exp(-np.abs(clock[:, None] - clock) / noise.tau_s) * same_run
        alike = noise.share * fading + (1.0 - noise.share) * alike
    whole = noise.scale**2 * np.einsum("ij,ab->iajb", np.eye(3), alike)
    together = (taken.visit[:, None] == taken.visit) & (taken.visit >= 0)
    moved = np.einsum("uia,ujb,ab->iajb", taken.motions, taken.motions, together)
    return (whole + noise.visit**2 * moved).reshape(3 * READINGS, -1)


@pytest.mark.parametrize("noise", CASES, ids=str)
def test_whitened_columns_have_the_inner_products_of_the_inverse_covariance(noise):
    rng = np.random.default_rng(1)
    taken = taking(rng)
    whole, whitening = covariance(taken, noise), Whitening(taken, noise)
    columns = rng.standard_normal((5, 3, READINGS))
    white = whitening.apply(columns).reshape(5, -1)
    flat = columns.reshape(5, -1)
    np.testing.assert_allclose(white @ white.T, flat @ np.linalg.solve(whole, flat.T), atol=1e-9)
    assert whitening.log_det == pytest.approx(np.linalg.slogdet(whole)[1], abs=1e-9)


@pytest.mark.skipif(not compiled(), reason="the filter was not compiled here")
@pytest.mark.parametrize("noise", CASES, ids=str)
def test_the_compiled_filter_whitens_as_numpy_does(noise):
    rng = np.random.default_rng(3)
    taken, columns = taking(rng), rng.standard_normal((70, 3, READINGS))
    whitening = Whitening(taken, noise)
    white = whitening.apply(columns)
    with kernel.reference():
        reference = Whitening(taken, noise)
        expected = reference.apply(columns)
    np.testing.assert_allclose(white, expected, rtol=0, atol=1e-12)
    assert whitening.log_det == pytest.approx(reference.log_det, abs=1e-11)


@pytest.mark.skipif(not in_one_pass(), reason="the filter was not compiled here")
@pytest.mark.parametrize("columns", [1, 24, 61])
@pytest.mark.parametrize("noise", CASES, ids=str)
def test_products_in_one_pass_are_those_of_white_columns(noise, columns):
    rng = np.random.default_rng(4)
    taken, rows = taking(rng), rng.standard_normal((READINGS, 3, columns))
    beam = rng.standard_normal((3, READINGS))
    scatter = Scatter({"some": np.arange(READINGS) < 9}, beam / np.linalg.norm(beam, axis=0))
    live = rng.uniform(size=(3, READINGS)) < 0.9
    taken = replace(taken, scatter=scatter, live=live)
    rows *= live.T[:, :, None]
    for own in ((), (("some", 1.7), ("along", 0.6))):
        whitening = Whitening(taken, replace(noise, scatter=own))
        found, log_det = whitening.products(rows)
        with kernel.reference():
            expected, reference = Whitening(taken, replace(noise, scatter=own)).products(rows)
        white = whitening.by_reading(rows).reshape(-1, columns)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)
        np.testing.assert_allclose(found, white.T @ white, rtol=0, atol=1e-11)
        assert log_det == pytest.approx(reference, abs=1e-11)


@pytest.mark.skipif(not in_one_pass(), reason="the filter was not compiled here")
def test_arrays_that_do_not_go_together_are_refused():
    from calib.noise import _filter

    two, three = np.zeros(2), np.zeros(3)
    with pytest.raises(ValueError, match="numbers are given"):
        _filter.gains(1, 1, 1, two, *[two] * 6)
    with pytest.raises(ValueError, match="too many"):
        _filter.gains(10**6, 10**6, 9, three, *[two] * 6)
    with pytest.raises(ValueError, match="no such reading"):
        _filter.innovations(1, 1, 0, 1, 1, np.array([1]), np.zeros(0), np.zeros(0), np.zeros(0),
                            np.zeros(9), three, np.zeros(3))  # fmt: skip
    with pytest.raises(TypeError):
        _filter.gains(1, 1, 1, np.zeros(3, dtype=int), *[two] * 6)
    sizes, none, one = (1, 1, 3, 0, 1, 1, 0), np.zeros(0), np.ones(1)
    seen, rest = np.zeros(9), (none, none, three, np.zeros(3), one)
    for reading, error in ((1, "no such reading"), (0, "numbers are given")):
        with pytest.raises(ValueError, match=error):
            _filter.products(*sizes, 1.0, 0.0, 0.0, np.array([reading]), np.zeros(1, dtype=int),
                             seen if reading else two, *rest)  # fmt: skip
    with pytest.raises(ValueError, match="go together"):
        _filter.products(1, 1, 2, 3, 1, 1, 0, 1.0, 0.0, 0.0, *[two] * 8)


def test_a_long_run_keeps_its_covariances():
    """What was read exactly is known exactly: rounding must not make less than nothing of it."""
    rng = np.random.default_rng(2)
    count = 600
    motions = 5.0 * rng.standard_normal((2, 3, count))
    taken = Taking(
        np.zeros(count, dtype=int), 4.0 * np.arange(count), np.arange(count) // 3, motions
    )
    whitening = Whitening(taken, Noise(tau_s=32.0, visit=0.28, by_row=True))
    alike = np.exp(-4.0 * np.abs(np.subtract.outer(np.arange(count), np.arange(count))) / 32.0)
    together = np.equal.outer(taken.visit, taken.visit)
    whole = np.einsum("ij,ab->iajb", np.eye(3), alike)
    whole += 0.28**2 * np.einsum("uia,ujb,ab->iajb", motions, motions, together, optimize=True)
    expected = np.linalg.slogdet(whole.reshape(3 * count, -1))[1]
    assert whitening.log_det == pytest.approx(expected, abs=1e-6)
