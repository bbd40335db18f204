from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.files.runs import read_run
from calib.effects import effect_named
from calib.identify import fit
from calib.model import Model
from calib.model.synthetic import drawn_from_prior, synthetic_rows
from calib.runs.stack import stack

RUNS = Path(__file__).parents[1] / "data" / "runs"


@pytest.fixture(scope="session")
def example():
    """Readings of an example run by name."""

    def load(name):
        loaded = read_run(RUNS / name)
        return stack(loaded.machine, [loaded.run])

    return load


@pytest.fixture(scope="session")
def simulated(example):
    """Readings of a machine drawn from the prior, on the poses of the run no-effect."""
    rows = example("no-effect")
    bare = Model(rows)
    frames = fit(bare).linear.state

    def make(seed, effects=None, noise=True):
        generator = np.random.default_rng(seed)
        truth = drawn_from_prior(bare, frames, generator)
        model = Model(rows, [effect_named(name, rows.machine) for name in effects or {}])
        given = tuple(np.array(v, dtype=float) for v in (effects or {}).values())
        truth = replace(truth, effects=given)
        return synthetic_rows(model, truth, generator if noise else None), truth

    return make
