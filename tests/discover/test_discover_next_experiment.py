"""The next experiment: separations are what a refit would find, chosen poses beat random ones."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from app.analysis import load_refitter
from app.files.machines import load_machine
from app.files.poses import read_pose_file
from app.verbs.design import command
from calib.discover.design import design_follow_up, told_apart
from calib.discover.follow_up import FollowUp, own_to_each_run
from calib.effects import effect_named
from calib.errors import BadInput
from calib.evidence.next_experiment import CandidateBlocks, Separation, choose_sequence
from calib.mechanism.solve import forward
from calib.model.columns import whitened_columns
from calib.poses.reach import sample_poses, solve_poses

RUNS = Path(__file__).parents[1] / "data" / "runs"


def distance(nuisance, precision, signature):
    """delta by brute force."""
    normal = nuisance @ nuisance.T + np.diag(precision)
    slope = nuisance @ signature
    return signature @ signature - slope @ np.linalg.solve(normal, slope)


def test_separation_grows_as_a_refit_would_find():
    rng = np.random.default_rng(5)
    nuisance, signature = rng.normal(size=(6, 20)), rng.normal(size=20)
    precision = np.array([0.0, 0.0, 1.0, 4.0, 9.0, 0.1])
    side = Separation(nuisance, precision, signature)
    assert side.delta == pytest.approx(distance(nuisance, precision, signature))
    for _ in range(3):
        blocks, moved = rng.normal(size=(4, 6, 3)), rng.normal(size=(4, 3))
        gains = side.gains(blocks, moved)
        for gain, block, one in zip(gains, blocks, moved, strict=True):
            both = np.hstack([nuisance, block]), precision, np.hstack([signature, one])
            assert side.delta + gain == pytest.approx(distance(*both))
        side.add(blocks[2], moved[2])
        nuisance = np.hstack([nuisance, blocks[2]])
        signature = np.hstack([signature, moved[2]])
        assert side.delta == pytest.approx(distance(nuisance, precision, signature))


def test_chosen_readings_beat_random_ones():
    rng = np.random.default_rng(6)
    offered = [CandidateBlocks(rng.normal(size=(60, 5, 2)), rng.normal(size=(60, 2))) for _ in "ab"]

    def sides():
        return [Separation(np.eye(5), np.ones(5), np.zeros(5)) for _ in "ab"]

    def reached(chosen):
        both = sides()
        for index in chosen:
            for side, block in zip(both, offered, strict=True):
                side.add(block.nuisance[index], block.signature[index])
        return min(side.delta for side in both)

    chosen = choose_sequence(sides(), lambda _: offered, 6)
    assert len(set(chosen)) == 6
    random = [reached(rng.choice(60, 6, replace=False)) for _ in range(200)]
    assert reached(chosen) > max(random)


@pytest.mark.parametrize(
    ("evidences", "falls", "p_value", "surely"),
    [
        ((20.0, 20.0 - np.log(4.0)), (60.0, 50.0), 1e-9, 0.8),
        ((50.0, 20.0), (120.0, 60.0), 1e-9, 1.0),
        ((20.0, 12.0), (60.0, 61.0), 1e-9, 0.5),
        ((20.0, 20.0), (60.0, 60.0), 0.4, 1.0),
    ],
)
def test_readings_are_as_sure_as_they_are_of_two_that_they_show(evidences, falls, p_value, surely):
    found = [
        SimpleNamespace(log_evidence=evidence, chi2_fall=fall, dof=2, p_value=p_value)
        for evidence, fall in zip(evidences, falls, strict=True)
    ]
    assert told_apart(found) == pytest.approx(surely, abs=1e-6)
    assert told_apart(found[::-1]) == told_apart(found)
    assert told_apart(found[:1]) == 1.0


@pytest.fixture(scope="module")
def fit():
    refit, _ = load_refitter((str(RUNS / "no-effect"),))
    return refit.fit(())


def test_direction_is_that_of_the_way_there(fit):
    poses = sample_poses(fit.model.machine, 20, np.random.default_rng(1))
    follow = FollowUp(fit, poses, {"payload_kg": 7.0})
    rows = follow.approached([3])
    nests = follow.nests
    first = np.sign(poses.q[:, 3] - rows.machine.home_q)
    np.testing.assert_array_equal(rows.direction[:, 3 * nests], first)
    expected = np.sign(poses.q[:, 5] - poses.q[:, 3])
    np.testing.assert_array_equal(rows.direction[:, 5 * nests + 1], expected)
    if "payload_kg" in rows.channels:
        assert set(rows.channels["payload_kg"]) == {7.0}


def test_columns_are_the_run_s_own_where_it_measured(fit):
    """The follow-up's columns at a pose of the run agree with the run's, sigma for sigma."""
    rows = fit.model.rows
    first = int(np.flatnonzero(rows.on_platform)[0])
    task = forward(rows.machine, rows.extension[:, [first]]).poses.to_xyz_rpy()
    follow = FollowUp(fit, solve_poses(rows.machine, task), {})
    effect = effect_named("screw-pitch", rows.machine)
    new = follow.by_pose(follow.columns(effect, np.zeros(6), follow.rows))[0]
    nest = list(rows.runs[0].header.platform_nests).index(rows.nest_name[first])
    old = whitened_columns(
        effect.signature(fit.linear.situation, np.zeros(6)), fit.linear.situation
    )[:, :, first]
    found = new.reshape(6, 3, follow.nests)[:, :, nest]
    assert np.linalg.norm(found - old) < 0.1 * np.linalg.norm(old)


def test_a_drift_belongs_to_its_run(fit):
    machine, rows = fit.model.machine, fit.model.rows
    assert own_to_each_run(effect_named("tracker-drift", machine), rows)
    assert not own_to_each_run(effect_named("backlash", machine), rows)


def test_follow_up_helps_to_tell_apart(fit):
    machine = fit.model.machine
    effects = [effect_named(name, machine) for name in ("tracker-scale", "tracker-offset")]
    plan = design_follow_up(fit, effects, 8, np.random.default_rng(3), candidates=80)
    assert plan.poses.count == 8
    assert set(plan.before) == set(plan.after) == {"tracker-scale", "tracker-offset"}
    assert sum(plan.after.values()) > sum(plan.before.values()) - 0.1


def test_payload_is_asked_for_where_it_decides(fit):
    machine = fit.model.machine
    effects = [effect_named("gravity-sag", machine)]
    plan = design_follow_up(
        fit, effects, 4, np.random.default_rng(3), candidates=40,
        conditions=[{"payload_kg": 0.0}, {"payload_kg": 12.0}],
    )  # fmt: skip
    assert plan.conditions["payload_kg"] in (0.0, 12.0)
    assert 0.0 <= plan.certainty <= 1.0


def test_effect_that_is_in_the_model_is_refused():
    refit, begin = load_refitter((str(RUNS / "backlash-leg-3"),), ("backlash",))
    fitted = refit.fit(begin)
    effect = effect_named("backlash", fitted.model.machine)
    with pytest.raises(BadInput, match="in the model already"):
        design_follow_up(fitted, [effect], 3, np.random.default_rng(0), candidates=30)


def test_verb_writes_a_poses_file_that_measure_reads(tmp_path):
    out = tmp_path / "follow.toml"
    answer = CliRunner().invoke(
        command,
        [str(RUNS / "no-effect"), "--discriminate", "backlash", "settling", "--n", "5",
         "--candidates", "60", "--add", "gravity-sag", "--out", str(out), "--json"],
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    assert "settling --add gravity-sag --candidates 60 --n 5 --seed 1" in out.read_text()
    report = json.loads(answer.stdout)
    assert report["format"] == "pkm-follow-up/1"
    read = read_pose_file(out, load_machine("hexapod"))
    assert len(read.labels) == len(report["poses"]) == 5
    assert set(report["right_then"]) == {"backlash", "settling"}


@pytest.mark.parametrize(
    "pair", [("backlash", "backlash"), ("nothing", "nothing"), ("foo", "nothing")]
)
def test_bad_pair_is_bad_input(pair):
    answer = CliRunner().invoke(command, [str(RUNS / "no-effect"), "--discriminate", *pair])
    assert isinstance(answer.exception, BadInput)
