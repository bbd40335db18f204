"""What happens at a moment of one of several runs: it is seen in that run, and in no follow-up."""

from dataclasses import replace

import numpy as np
import pytest

from app.files.machines import load_machine
from calib.discover.advice import advice
from calib.discover.discovery import Refitter, discover_run, stage_of
from calib.discover.follow_up import FollowUp
from calib.effects import effect_named
from calib.effects.run_clock import run_starts
from calib.poses.reach import sample_poses
from calib.runs import parse_run
from calib.runs.stack import Rows, stack
from mocks.hidden.table import Hidden
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import RunPlan
from mocks.simulate.run import simulate

PLAN = RunPlan(machine="hexapod", seed=11, poses=14, noise_mm=0.005)
SHIFT = {
    "frame-shift.x": 0.06,
    "frame-shift.y": -0.05,
    "frame-shift.t0": 200.0,
    "frame-shift.where": 1.0,
}


@pytest.fixture(scope="module")
def rows() -> Rows:
    """A quiet run, then one of the same machine in which the base was touched."""
    first = simulate(PLAN)
    again = replace(PLAN, seed=12, parameters=first.parameters, hidden=Hidden(SHIFT))
    return stack(
        load_machine("hexapod"),
        [
            parse_run(run_toml(one), points_csv(one), actuators=6)
            for one in (first, simulate(again))
        ],
    )


def test_a_frame_that_shifts_in_the_second_of_two_runs_is_named(rows: Rows) -> None:
    machine = rows.machine
    asked = [effect_named(name, machine) for name in ("frame-shift", "tracker-drift", "backlash")]
    refit = Refitter(rows, asked)
    best = refit(()).diagnosis.best
    assert best is not None
    assert best.name == "frame-shift"
    fitted = refit(("frame-shift",)).fit
    at = fitted.model.free.size
    names = [unknown.name for unknown in fitted.model.unknowns[0]]
    found = dict(zip(names, fitted.values[at : at + len(names)].tolist(), strict=True))
    assert found["frame-shift.where"] == pytest.approx(1.0, abs=0.01)
    assert found["frame-shift.x"] == pytest.approx(0.06, abs=0.02)
    assert abs(found["frame-shift.t0"] - run_starts(rows)[1] - 200.0) < 40.0


@pytest.mark.parametrize("name", ["frame-shift", "actuator-step"])
def test_it_is_over_when_its_run_ends(rows: Rows, name: str) -> None:
    effect = effect_named(name, rows.machine)
    fitted = Refitter(rows, [effect]).fit(())
    values = np.zeros(len(effect.unknowns(rows)))
    values[6] = 200.0  # t0 in the first run
    signature = effect.signature(fitted.linear.situation, values)
    moved = [
        one for one in (signature.nest, signature.point, signature.extension) if one is not None
    ]
    assert np.any(moved[0][..., rows.run == 0])
    assert not np.any(moved[0][..., rows.run == 1])
    poses = sample_poses(rows.machine, 3, np.random.default_rng(1))
    follow = FollowUp(fitted, poses, {})
    one = values[: len(effect.unknowns(follow.rows))]
    assert not np.any(follow.columns(effect, one, follow.approached([])))


def test_an_actuator_that_is_elsewhere_in_the_second_run_is_off_from_its_start() -> None:
    plan = replace(PLAN, poses=10, nests=("3", "4"))
    first = simulate(plan)
    moved = {**first.parameters, "leg4.L0": first.parameters["leg4.L0"] + 0.1}
    again = simulate(replace(plan, seed=12, parameters=moved))
    machine = load_machine("hexapod")
    texts = [(run_toml(one), points_csv(one)) for one in (first, again)]
    rows = stack(machine, [parse_run(*text, actuators=6) for text in texts])
    asked = [effect_named(name, machine) for name in ("actuator-step", "leg-warm-up")]
    refit = Refitter(rows, asked)
    best = refit(()).diagnosis.best
    assert best is not None
    assert best.name == "actuator-step"
    fitted = refit(("actuator-step",)).fit
    found = dict(zip(fitted.model.names, fitted.values.tolist(), strict=True))
    assert found["actuator-step.leg4"] == pytest.approx(0.1, abs=0.02)
    assert abs(found["actuator-step.t0"] - run_starts(rows)[1]) < 1e-6


@pytest.mark.long
def test_runs_of_two_machines_are_said_to_be_so_before_any_effect() -> None:
    machine = load_machine("hexapod")
    plan = replace(PLAN, poses=10, nests=("3", "4"))
    made = [simulate(replace(plan, seed=seed)) for seed in (21, 22)]
    texts = [(run_toml(one), points_csv(one)) for one in made]
    rows = stack(machine, [parse_run(*text, actuators=6) for text in texts])
    refit = Refitter(rows, [effect_named(name, machine) for name in ("backlash", "screw-pitch")])
    found = discover_run(refit)
    assert len(found.steps) == 1
    assert "two machines" in advice(stage_of(found).run)
