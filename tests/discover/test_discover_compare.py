"""Compare: what speaks comes first, repeatability before all, pictures that show the truth."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from discover_synthetic import POSES, Lab

from app.files.runs import read_runs
from app.verbs.compare import command
from calib.discover.compare import compare_fit, pose_residuals
from calib.evidence import Response, Variable, pure_error
from calib.evidence.compare import compare_structure
from calib.formulas.effect_file import effect_from_text
from calib.identify import fit
from calib.model import Model
from calib.runs.stack import stack

RUNS = Path(__file__).parents[1] / "data" / "runs"


def fitted(name):
    loaded = read_runs((str(RUNS / name),))
    return fit(Model(stack(loaded[0].machine, [one.run for one in loaded])))


@pytest.fixture(scope="module")
def backlash():
    return compare_fit(fitted("backlash-leg-3"), np.random.default_rng(0))


def test_direction_speaks_first_and_its_picture_shows_half_the_backlash(backlash):
    first = backlash.speaking[0]
    assert (first.channel, first.acts_on, first.axis) == ("direction", "legs", 2)
    assert first.significant
    low, high = first.bins
    assert (low.low, high.low) == (-1.0, 1.0)
    truth = json.loads((RUNS / "backlash-leg-3" / "truth.json").read_text())
    half = 0.5 * truth["hidden"]["backlash.leg3"]
    assert low.value == pytest.approx(half, abs=3 * low.sigma)
    assert high.value == pytest.approx(-half, abs=3 * high.sigma)
    assert high.sigma < 0.001


def test_actuator_residual_points_to_the_leg(backlash):
    extension = backlash.poses.extension
    assert np.isfinite(extension).all()
    assert np.argmax(np.sqrt(np.mean(extension**2, axis=1))) == 2


def test_nothing_speaks_where_nothing_is_hidden():
    found = compare_fit(fitted("no-effect"), np.random.default_rng(0))
    assert not any(one.significant for one in found.speaking)
    assert not any(one.significant for one in found.together)


def test_periodic_dependence_is_folded_to_its_period():
    found = compare_fit(fitted("mystery"), np.random.default_rng(0))
    periods = [one.period for one in found.speaking if one.significant and one.period]
    assert periods
    assert np.allclose(periods, 4.0, atol=0.15)
    wave = next(one for one in found.speaking if one.period)
    assert max(each.high for each in wave.bins) <= wave.period


def test_actuator_error_put_in_is_read_off():
    clean = fitted("no-effect")
    error = np.random.default_rng(3).normal(0.0, 0.02, (6, clean.model.rows.count))
    names = clean.model.rows.pose_name
    where = {name: index for index, name in enumerate(dict.fromkeys(names))}
    error = error[:, [where[name] for name in names]]
    columns = clean.linear.situation.actuator_columns
    whitened = np.einsum("ujn,un->jn", columns, error)
    altered = replace(clean, linear=replace(clean.linear, whitened=whitened))
    found = pose_residuals(altered)
    expected = [error[:, names.index(name)] for name in found.names]
    np.testing.assert_allclose(found.extension, np.transpose(expected), atol=1e-10)


def test_bins_show_the_shape_that_was_put_in():
    lab = Lab(12)
    hidden = lab.one(6.0 * np.sign(lab.warmth - np.median(lab.warmth)), 1)
    response = Response("axes", lab.two(np.ones(POSES)), size=4.0)
    variables = [
        Variable(name, np.tile(values, 2), (response,))
        for name, values in (("x", lab.x), ("warmth", lab.warmth))
    ]
    problem = lab.fitted(hidden, np.random.default_rng(1))
    speaking, _ = compare_structure(
        problem, variables, [], components=2, rng=np.random.default_rng(2)
    )
    assert speaking[0].channel == "warmth"
    assert speaking[0].axis == 1
    pulls = [
        (each.value - 6.0 * np.sign(each.low - np.median(lab.warmth))) / each.sigma
        for each in speaking[0].bins
        if (each.low > np.median(lab.warmth)) == (each.high > np.median(lab.warmth))
    ]
    assert np.sqrt(np.mean(np.square(pulls))) < 2.0


def test_pure_error_of_repeats():
    rng = np.random.default_rng(8)
    state = np.repeat(np.arange(200), 3)
    shift = 5.0 * rng.normal(size=(3, 200))[:, state]
    noise = rng.normal(size=(3, 600))
    repeatable = pure_error(shift + noise, list(state), 1800.0)
    assert repeatable.dof == 1200
    assert repeatable.variance == pytest.approx(1.0, abs=0.13)
    assert repeatable.excess < 0.01
    restless = pure_error(2.0 * noise, list(state), 1800.0)
    assert restless.variance == pytest.approx(4.0, abs=0.5)
    assert restless.p_value < 1e-9
    assert restless.excess == pytest.approx(2 / 3, abs=0.05)
    assert pure_error(noise, [None] * 600, 1800.0).dof == 0


@pytest.mark.long
def test_verb_answers_json_and_draws(tmp_path):
    answer = CliRunner().invoke(
        command, [str(RUNS / "backlash-leg-3"), "--json", "--out", str(tmp_path / "figures")]
    )
    assert answer.exit_code == 0, answer.output
    report = json.loads(answer.stdout)
    assert report["format"] == "pkm-compare/1"
    assert report["structure"][0]["channel"] == "direction"
    assert report["reference_repeatability"]["dof"] > 0
    drawn = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert drawn == ["actuators.png", "structure.png", "workspace.png"]


def test_effect_that_is_added_falls_silent():
    answer = CliRunner().invoke(
        command, [str(RUNS / "backlash-leg-3"), "--json", "--add", "backlash"]
    )
    report = json.loads(answer.stdout)
    assert "direction" not in [one["channel"] for one in report["structure"] if one["significant"]]


@pytest.mark.long
def test_proposed_terms_are_written_as_effect_files(tmp_path):
    file = tmp_path / "own.toml"
    answer = CliRunner().invoke(
        command, [str(RUNS / "backlash-leg-3"), "--json", "--propose", str(file)]
    )
    report = json.loads(answer.stdout)
    first = report["proposed"][0]
    assert first["formula"] == "a * direction"
    assert first["stability"] > 0.9
    assert effect_from_text(file.read_text(), "own.toml").id == "found-1"
