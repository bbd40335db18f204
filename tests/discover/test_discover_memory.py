"""An effect with a memory, of one's own: what it does depends on every turn of the way there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.files.runs import read_run
from calib.arrays import Array
from calib.discover.design import design_follow_up
from calib.discover.diagnosis import diagnose_fit
from calib.discover.follow_up import FollowUp
from calib.effects import effect_named
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.identify import fit
from calib.model import Model
from calib.model.synthetic import synthetic_rows
from calib.poses.reach import sample_poses
from calib.runs.commanded import CommandedPath
from calib.runs.stack import Rows, stack
from calib.unknown import Unknown

RUNS = Path(__file__).parents[1] / "data" / "runs"
REACH_MM = 12.0
TRUE = np.array([0.0, 0.0, 2e-3, 0.0, -1.5e-3, 0.0])


class Hysteresis(Effect):
    """Friction drags a spring along: the leg yields by k (s - w), w following s within a reach."""

    id = "hysteresis"
    kind = "machine"
    says = "a spring is dragged along and keeps part of its strain after a short way back"
    depends = ("path",)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        return tuple(Unknown(f"hysteresis.{axis.name}", "1", 1e-3) for axis in rows.machine.axes)

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        return alone(len(rows.machine.axes))

    def signature(self, situation: Situation, values: Array) -> Signature:
        rows = situation.rows
        return Signature(extension=per_actuator(strain(rows.path)[:, rows.at]))


def strain(path: CommandedPath) -> Array:
    """s - w (n, M) with the play operator w: it follows only where the reach is used up."""
    s = path.extension
    w = path.carry(s, lambda w, row: np.clip(w, s[:, row] - REACH_MM, s[:, row] + REACH_MM))
    return s - w


@pytest.fixture(scope="module")
def bare() -> Rows:
    loaded = read_run(RUNS / "no-effect")
    return stack(loaded.machine, [loaded.run])


@pytest.fixture(scope="module")
def dragged(bare: Rows) -> Rows:
    """Readings of a machine that has the effect."""
    model = Model(bare, [Hysteresis()])
    truth = replace(fit(Model(bare)).linear.state, effects=(TRUE,), near=None)
    return synthetic_rows(model, truth, np.random.default_rng(2))


def test_a_short_way_back_keeps_part_of_the_strain():
    way = np.array([[0.0, 30.0, 20.0, 25.0, -10.0, 0.0]])
    path = CommandedPath.of_run(way, np.arange(6.0), np.array([1e-4]))
    np.testing.assert_allclose(strain(path)[0], [0.0, 12.0, 2.0, 7.0, -12.0, -2.0])


def test_it_is_fitted(dragged):
    found = fit(Model(dragged, [Hysteresis()]))
    own = slice(found.model.free.size, found.model.free.size + 6)
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    assert np.all(np.abs(found.values[own] - TRUE) < 4.5 * found.sigmas[own])
    assert np.all(found.sigmas[own] < 0.3e-3)
    assert fit(Model(dragged)).chi2_per_dof > 1.3


def test_readings_of_one_pose_with_another_past_are_other_states(dragged):
    """What is predicted for a reading does not depend on which others are in the model."""
    order = np.random.default_rng(8).permutation(dragged.count)
    way = CommandedPath.of_run(
        dragged.extension[:, order], np.arange(float(order.size)), dragged.path.motion
    )
    rows = replace(dragged, path=way, at=np.argsort(order).astype(np.intp))
    state = fit(Model(dragged, [Hysteresis()])).linear.state
    state = replace(state, near=None)
    whole = Model(rows, [Hysteresis()]).predict(state)
    same = [name == "7" for name in rows.pose_name]
    few = [*np.flatnonzero(same), *np.flatnonzero(rows.on_platform)[::17]]
    for row in few:
        alone = Model(rows.take([row]), [Hysteresis()]).predict(state)
        np.testing.assert_allclose(alone[:, 0], whole[:, row], atol=1e-7)


def test_it_is_diagnosed_beside_the_catalogue(dragged):
    offered = [effect_named(n, dragged.machine) for n in ("backlash", "screw-pitch", "settling")]
    found = diagnose_fit(fit(Model(dragged)), [*offered, Hysteresis()], np.random.default_rng(1))
    first = found.diagnosis.findings[0]
    assert first.name == "hysteresis"
    assert first.p_value < 1e-3
    assert found.outlook(first).rms_mm < found.fit.rms_mm


@pytest.mark.parametrize("rival", ["backlash", None])
def test_a_follow_up_is_designed_for_it(dragged, rival):
    effects = [Hysteresis(), *([effect_named(rival, dragged.machine)] if rival else [])]
    fitted = fit(Model(dragged))
    plan = design_follow_up(
        fitted, effects, 4, np.random.default_rng(3), candidates=30, conditions=[{}]
    )
    assert plan.poses.count == 4
    assert set(plan.after) == {effect.id for effect in effects}
    assert plan.after["hysteresis"] >= plan.before["hysteresis"] - 0.05


def test_a_designed_pose_has_the_past_that_the_machine_will_give_it(dragged):
    """As on a run that really goes from home to the chosen poses, one after the other."""
    poses = sample_poses(dragged.machine, 12, np.random.default_rng(5))
    follow = FollowUp(fit(Model(dragged)), poses, {})
    chosen = [7, 2, 9, 4]
    held = dragged.runs[-1].header.controller_parameters
    home = dragged.machine.home_q[:, None]
    way = dragged.machine.extension(np.column_stack([home, poses.q[:, chosen]]), held)
    real = CommandedPath.of_run(way, np.arange(5.0), dragged.path.motion)
    for number, index in enumerate(chosen):
        rows = follow.approached(chosen[:number])
        here = rows.at[index * follow.nests]
        np.testing.assert_allclose(
            strain(rows.path)[:, here], strain(real)[:, number + 1], atol=1e-12
        )
        np.testing.assert_array_equal(rows.path.step[:, here], real.step[:, number + 1])
        assert np.all(np.diff(rows.path.time_s[: number + 2]) > 0.0)
