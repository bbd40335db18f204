"""Score tests say where a search for noise is worth its time."""

import numpy as np
import pytest

from calib.noise import Noise
from calib.noise.component import WHITE
from calib.noise.likelihood import Likelihood
from calib.noise.score import promising
from calib.noise.sizes import Sizes, joined
from tests.noise.test_noise_estimate import lab

SAID = {"correlated": "time", "visit": "visit", "scale": "scale"}


@pytest.mark.parametrize("seed", range(8))
def test_whatever_would_rise_is_asked_for(seed):
    problem, taking = lab(Noise(), np.random.default_rng(seed))
    likelihood = Likelihood(problem, taking)
    white = likelihood.of(WHITE)
    pointed = promising(*likelihood.left(WHITE), taking)
    for part, said in SAID.items():
        rise = white - joined(likelihood, Sizes((), (), white), part).value
        assert said in pointed or rise < (2.5 if part == "scale" else 0.5)


@pytest.mark.parametrize(
    ("noise", "said"),
    [(Noise(tau_s=6.0), "time"), (Noise(visit=0.2), "visit"), (Noise(scale=1.15), "scale")],
    ids=["time", "visit", "scale"],
)
def test_what_there_is_is_asked_for(noise, said):
    for seed in range(4):
        problem, taking = lab(noise, np.random.default_rng(seed))
        assert said in promising(*Likelihood(problem, taking).left(WHITE), taking)


def test_white_noise_is_mostly_asked_for_nothing():
    asked = 0
    for seed in range(20):
        problem, taking = lab(Noise(), np.random.default_rng(100 + seed))
        asked += len(promising(*Likelihood(problem, taking).left(WHITE), taking))
    assert asked < 30
