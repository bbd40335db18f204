"""An effect of one run of several: it moves the readings of that run as it would, no others."""

from dataclasses import replace

import numpy as np
import pytest

from app.files.machines import load_machine
from calib.discover.discovery import Refitter, discover_run, stage_of
from calib.effects import catalogue, effect_named
from calib.effects.of_one_run import each_alone
from calib.errors import BadInput
from calib.identify import fit
from calib.identify.signatures import effect_columns
from calib.model import Model
from calib.runs import parse_run
from calib.runs.stack import Rows, stack
from mocks.hidden.table import Hidden
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import RunPlan
from mocks.simulate.run import simulate


@pytest.fixture(scope="module")
def two_years() -> Rows:
    """The same machine twice; between the runs leg 3 has got play."""
    first = RunPlan(machine="hexapod", seed=3, poses=14, noise_mm=0.005)
    before = simulate(first)
    worn = Hidden({"backlash.leg3": 0.04})
    after = simulate(replace(first, seed=9, hidden=worn, parameters=before.parameters))
    runs = [parse_run(run_toml(one), points_csv(one), actuators=6) for one in (before, after)]
    return stack(load_machine("hexapod"), runs)


@pytest.mark.parametrize("name", ["backlash", "thermal-growth", "screw-twist", "hysteresis"])
def test_one_run_is_moved_as_by_the_effect_and_the_other_not_at_all(two_years, name):
    machine = two_years.machine
    shared, alone = effect_named(name, machine), effect_named(f"{name}@2", machine)
    fitted = fit(Model(two_years))
    (whole,), (own,) = effect_columns(fitted, [shared]), effect_columns(fitted, [alone])
    second = two_years.run == 1
    assert own.trials == whole.trials
    np.testing.assert_array_equal(own.at(0)[:, :, second], whole.at(0)[:, :, second])
    assert not own.at(0)[:, :, ~second].any()
    assert own.unknowns[0].name == whole.unknowns[0].name.replace(name, f"{name}@2")


def test_what_came_between_two_runs_is_found_and_measured(two_years):
    shared = [effect_named(name, two_years.machine) for name in ("backlash", "thermal-growth")]
    refit = Refitter(two_years, (*shared, *each_alone(shared, two_years)))
    found = discover_run(refit)
    assert found.last.effects == ("backlash@2",)
    fitted = stage_of(found).run.fit
    at = fitted.model.names.index("backlash@2.leg3")
    assert abs(fitted.values[at] - 0.04) < 4.0 * fitted.sigmas[at] < 0.012


def test_runs_that_are_not_there_and_effects_that_are_of_all_runs_are_refused(two_years):
    machine = two_years.machine
    assert "there is no run 3" in effect_named("backlash@3", machine).unavailable(two_years)
    with pytest.raises(BadInput, match="is of all runs"):
        effect_named("redundancy@1", load_machine("ptm"))
    with pytest.raises(BadInput, match="unknown effect"):
        effect_named("backlash@0", machine)


def test_no_such_effect_is_written_to_a_machine_and_one_run_has_none(two_years):
    machine = two_years.machine
    alone = each_alone(catalogue(machine), two_years)
    assert {"backlash@1", "backlash@2", "screw-pitch@2"} <= {effect.id for effect in alone}
    assert {effect.kind for effect in alone} == {"measurement"}
    assert not {"warm-up@1", "actuator-step@1", "lead-cubic@1"} & {effect.id for effect in alone}
