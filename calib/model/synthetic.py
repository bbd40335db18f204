"""Readings that a model would give, for predicted power, coverage and tests."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.model.prediction import Model
from calib.model.state import State
from calib.runs.stack import Rows


def synthetic_rows(model: Model, state: State, generator: np.random.Generator | None) -> Rows:
    """Replace the readings by what ``model`` predicts at ``state``, plus noise of their covariance.

    Without a generator the readings are exact.
    """
    predicted = model.rows.position - model.linearise(state).residual
    if generator is not None:
        predicted = predicted + noise(model.rows, generator)
    return replace(model.rows, position=predicted)


def noise(rows: Rows, generator: np.random.Generator) -> Array:
    """Errors (3, N) in mm drawn from the readings' covariances."""
    return rows.in_mm(generator.standard_normal((rows.count, 3)).T)


def drawn_from_prior(model: Model, state: State, generator: np.random.Generator) -> State:
    """Draw machine parameters from their Gaussian priors; frames and effects stay."""
    parameters = model.machine.nominal.copy()
    parameters += model.machine.prior_sigma * generator.standard_normal(parameters.size)
    return replace(state, parameters=parameters, near=None)
