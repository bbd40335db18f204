"""Many sets of readings fitted together are as each fitted by itself."""

from dataclasses import replace

import numpy as np
import pytest

from app.files.machines import load_machine
from calib.arrays import Array
from calib.identify import fit
from calib.identify.batch import fit_draws
from calib.model import Model
from calib.model.many import Many, drawn_readings
from calib.model.prototype import prototype_run
from calib.model.state import State
from calib.poses.reach import sample_poses
from calib.runs.stack import stack

SETS = 5


@pytest.fixture(scope="module", params=["hexapod", "tripod", "delta", "arm"])
def study(request: pytest.FixtureRequest) -> tuple[Model, State]:
    machine = load_machine(request.param)
    generator = np.random.default_rng(2)
    poses = sample_poses(machine, 14, generator)
    made = prototype_run(machine, request.param, poses, machine.nominal, 0.005, generator)
    model = Model(stack(machine, [made.run]))
    return model, fit(model).linear.state


def drawn(study: tuple[Model, State], count: int = SETS) -> Array:
    model, state = study
    return drawn_readings(model, state, [(3, draw) for draw in range(count)])[1]


def test_together_is_as_one_by_one(study: tuple[Model, State]) -> None:
    model, state = study
    position = drawn(study)
    found = fit_draws(model, position, state)
    assert not found.alone.any()
    for draw in range(SETS):
        own = fit(Model(replace(model.rows, position=position[:, :, draw])))
        assert np.max(np.abs(found.values[:, draw] - own.values) / own.sigmas) < 3e-3
        np.testing.assert_allclose(found.sigmas[:, draw], own.sigmas, rtol=2e-3)
        assert found.chi2[draw] == pytest.approx(own.chi2, abs=5e-3)


def test_readings_that_are_drawn_are_those_of_the_model(study: tuple[Model, State]) -> None:
    model, state = study
    parameters, position = drawn_readings(model, state, [(3, 0), (3, 1)])
    for draw in range(2):
        truth = replace(state, parameters=parameters[:, draw], near=None)
        off = Many(model).whitened((position[:, :, draw] - model.predict(truth))[:, :, None])
        assert 0.5 < np.std(off) < 1.5
    alone = drawn_readings(model, state, [(3, 1)])
    np.testing.assert_allclose(alone[1][:, :, 0], position[:, :, 1], rtol=0.0, atol=1e-7)
    np.testing.assert_array_equal(alone[0][:, 0], parameters[:, 1])


def test_what_is_not_plain_is_fitted_by_itself(study: tuple[Model, State]) -> None:
    model, state = study
    position = drawn(study, 4)
    at = int(np.flatnonzero(model.rows.on_platform)[7])
    position[:, at, 1] += 0.15  # thirty sigmas: a stray
    position[:, at, 2] += 200.0  # where no nest is
    found = fit_draws(model, position, state)
    assert found.alone.tolist() == [False, True, True, False]
    own = fit(Model(replace(model.rows, position=position[:, :, 1])))
    assert [bad.row for bad in own.bad] == [at]
    np.testing.assert_array_equal(found.values[:, 1], own.values)
