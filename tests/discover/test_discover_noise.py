"""Runs whose noise is not white: the noise is named, and no effect or structure is."""

from dataclasses import replace

import numpy as np
import pytest

from app.files.machines import load_machine
from calib.discover.diagnosis import RunDiagnosis
from calib.discover.discovery import Refitter, discover_run, stage_of
from calib.discover.noise_report import noise_words
from calib.discover.report import diagnosis_report
from calib.effects import catalogue
from calib.runs import parse_run
from calib.runs.stack import Rows, stack
from mocks.hidden.table import Hidden
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import RunPlan
from mocks.simulate.run import simulate

pytestmark = pytest.mark.long

SIGMA_MM = 0.005
DRIFT = {"tracker-drift.vx": 0.03, "tracker-drift.wz": 2e-5}


def measured(hidden: dict[str, float], rho: float, seed: int, *, walk: float = 0.0) -> Rows:
    """A run of the hexapod; its noise follows itself from reading to reading, or wanders."""
    plan = RunPlan(machine="hexapod", seed=seed, poses=40, noise_mm=SIGMA_MM, hidden=Hidden(hidden))
    clean = simulate(plan)
    exact = parse_run(run_toml(clean), points_csv(clean), actuators=6)
    rows = stack(load_machine("hexapod"), [exact])
    quiet = stack(load_machine("hexapod"), [parse_run(run_toml(clean), points_csv(
        simulate(replace(plan, noise_mm=1e-6))), actuators=6)])  # fmt: skip
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((3, rows.count))
    for k in range(1, rows.count):
        noise[:, k] = rho * noise[:, k - 1] + np.sqrt(1.0 - rho**2) * noise[:, k]
    noise += walk * np.cumsum(rng.standard_normal(noise.shape), axis=1)
    return replace(rows, position=quiet.position + SIGMA_MM * noise)


def words(found: RunDiagnosis) -> str:
    """What is said of the noise."""
    return noise_words(found.fit)


@pytest.mark.parametrize(
    ("hidden", "expected"), [({}, ()), ({"backlash.leg3": 0.03}, ("backlash",))]
)
def test_correlated_noise_is_named_and_nothing_else_but_what_is_there(hidden, expected):
    rows = measured(hidden, 0.5, seed=4)
    found = discover_run(Refitter(rows, catalogue(rows.machine)))
    last = stage_of(found).run
    assert found.last.effects == expected
    assert last.diagnosis.adequate
    assert "the noise is correlated over" in words(last)
    assert last.fit.components_of_noise[0].name == "correlated"
    assert last.fit.components_of_noise[0].p_value < 1e-6


@pytest.mark.parametrize(("hidden", "expected"), [({}, ()), (DRIFT, ("tracker-drift",))])
def test_a_wandering_tracker_and_one_that_drifts_are_told_apart(hidden, expected):
    rows = measured(hidden, 0.0, seed=5, walk=0.0 if hidden else 0.3)
    answer = Refitter(rows, catalogue(rows.machine))(()).run
    assert answer.diagnosis.explained_by == expected
    assert [one.name for one in answer.fit.components_of_noise] == ([] if hidden else ["walk"])
    assert ("the noise wanders by" in words(answer)) == (not hidden)


def shifted(size: float, t0: float) -> RunDiagnosis:
    """What is said of a run in which the base moved."""
    moved = {"frame-shift.y": 0.5 * size, "frame-shift.z": -size, "frame-shift.where": 1.0}
    rows = measured({**moved, "frame-shift.t0": t0}, 0.0, seed=3)
    return Refitter(rows, catalogue(rows.machine))(()).run


def test_a_large_step_between_two_readings_of_a_pose_is_no_noise_that_wanders():
    answer = shifted(0.2, 900.0)
    assert answer.diagnosis.explained_by[0] == "frame-shift"
    assert "walk" not in {one.name for one in answer.fit.components_of_noise}


def test_an_effect_that_says_as_much_as_noise_is_told_beside_it():
    answer = shifted(0.012, 500.0)
    assert answer.noise_or == ("frame-shift",)
    noise = diagnosis_report(answer)["noise"]
    assert noise["instead"] == ["frame-shift"]
    assert noise["words"].endswith("Or it is frame-shift: these readings do not tell")
    assert "Nothing else is clearly missing" in diagnosis_report(answer)["advice"]
