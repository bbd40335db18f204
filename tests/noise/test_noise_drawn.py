"""Draws of noise are white once they are freed of what they share."""

import numpy as np
import pytest

from calib.noise import Noise, Scatter, Taking, Whitening, drawn

READINGS, DRAWS = 24, 1500
WALK = Noise(scale=8.3, tau_s=26_000.0, share=0.985, step=0.28)
CASES = [
    Noise(scale=1.3),
    Noise(tau_s=20.0, share=0.6, scale=1.2),
    Noise(tau_s=20.0, by_row=True),
    Noise(visit=0.5, tau_s=30.0, share=0.5),
    Noise(scale=0.9, scatter=(("nest 1", 3.0),)),
]


def taking(rng: np.random.Generator) -> Taking:
    """Two runs in any order, visits of three readings, one nest read at every third."""
    mixed = rng.permutation(READINGS)
    run = np.repeat([0, 1], READINGS // 2)[mixed]
    time = np.tile(np.sort(rng.uniform(0.0, 200.0, READINGS // 2)), 2)[mixed]
    visit = np.where(np.arange(READINGS) < 3, -1, np.arange(READINGS) // 3)[mixed]
    scatter = Scatter({"nest 1": mixed % 3 == 0}, np.zeros((3, READINGS)), {})
    return Taking(run, time, visit, rng.standard_normal((4, 3, READINGS)), scatter=scatter)


@pytest.mark.parametrize("noise", CASES, ids=str)
def test_draws_are_white_once_they_are_freed_of_what_they_share(noise: Noise) -> None:
    rng = np.random.default_rng(2)
    taken = taking(rng)
    white = Whitening(taken, noise).apply(drawn(taken, noise, DRAWS, rng)).reshape(DRAWS, -1)
    found = white.T @ white / DRAWS
    assert np.abs(found - np.eye(3 * READINGS)).max() < 5.5 / np.sqrt(DRAWS)


def test_what_wanders_begins_a_run_at_nothing() -> None:
    rng = np.random.default_rng(4)
    taken = taking(rng)
    found = drawn(taken, WALK, DRAWS, rng)
    first = [taken.order[taken.run[taken.order] == run][0] for run in (0, 1)]
    narrow = WALK.narrow
    assert np.std(found[:, :, first]) == pytest.approx(narrow, rel=0.05)
