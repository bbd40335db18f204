"""Laws of the fit: exact on exact data, true in its uncertainty, blunt about bad readings."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli import run as pkmcal
from calib.effects import catalogue
from calib.errors import BadInput
from calib.identify import fit, fit_report, hold_out
from calib.identify.report import unidentified_groups, unidentified_words
from calib.model import Model
from calib.model.synthetic import drawn_from_prior, synthetic_rows

RUNS = Path(__file__).parents[1] / "data" / "runs"


def changed(rows, row, shift):
    position = rows.position.copy()
    position[:, row] += shift
    return replace(rows, position=position)


def test_identify_example_without_effect_reaches_the_noise(example):
    report = fit_report(fit(Model(example("no-effect"))))
    assert report["chi2_per_dof"] == pytest.approx(1.0, abs=0.1)
    assert report["bad_readings"] == []
    assert report["rms_um"] == pytest.approx(report["noise_floor_um"], rel=0.1)
    assert report["holdout_rms_um"] == pytest.approx(report["holdout_floor_um"], rel=0.1)
    assert ["leg3.L_B"] in report["unidentified"]


def test_identify_unknowns_that_the_readings_determine_are_counted_by_the_hat_matrix(example):
    found = fit(Model(example("no-effect")))
    normal = found.jacobian @ found.jacobian.T + np.diag(found.prior_precision)
    hat = np.sum(found.jacobian * np.linalg.solve(normal, found.jacobian))
    assert found.trace_hat == pytest.approx(hat, rel=1e-6)
    assert found.dof == pytest.approx(3.0 * found.readings - hat, rel=1e-6)
    assert 6.0 < hat < found.model.prior.size


def test_identify_exact_readings_leave_no_residual(simulated):
    """Without noise the prediction is met; the priors hold back only what hardly shows."""
    rows, _ = simulated(3, noise=False)
    found = fit(Model(rows))
    assert found.rms_mm < 1e-3
    assert found.chi2 < 5.0


@pytest.mark.long
def test_identify_jacobian_with_every_effect_against_central_differences(example):
    whole = example("backlash-leg-3")
    frames = fit(Model(whole)).linear.state
    some = {"", *map(str, range(5, 80, 7))}
    rows = whole.take([name in some for name in whole.pose_name])
    model = Model(rows, catalogue(rows.machine))
    generator = np.random.default_rng(5)
    effects = tuple(
        np.array(
            [3.7 if u.nonlinear else 1e-2 * u.size * generator.standard_normal() for u in group]
        )
        for group in model.unknowns
    )
    begin = replace(model.start(frames.frame_rotation, frames.frame_position), effects=effects)
    linear = model.linearise(model.linearise(begin).state)
    # Along random directions in which every unknown moves the readings alike.
    reach = np.sqrt(np.sum(linear.jacobian**2, axis=(1, 2)))
    most = 0.1 * np.minimum(model.prior, 1.0)
    unknowns = [unknown for group in model.unknowns for unknown in group]
    for index, unknown in enumerate(unknowns, start=model.free.size):
        most[index] = 1e-4 if unknown.nonlinear else min(most[index], 10.0 * unknown.size)
    size = np.minimum(0.02 / np.maximum(reach, 1e-12), most)
    for _ in range(6):
        step = size * generator.standard_normal(size.size)
        ahead, back = (model.predict(model.moved(linear.state, s * step)) for s in (1.0, -1.0))
        slope = np.einsum("ijn,jn->in", rows.whitener, 0.5 * (ahead - back))
        own = np.tensordot(step, linear.jacobian, axes=1)
        # An effect's shape moves with the pose that it moves: some 1e-3 of it, no error.
        np.testing.assert_allclose(own, slope, atol=6e-3 * np.abs(own).max())


def test_identify_whitening_and_back(example):
    rows = example("no-effect")
    unit = np.einsum("ijn,jkn,lkn->iln", rows.whitener, rows.covariance, rows.whitener)
    np.testing.assert_allclose(unit, np.eye(3)[:, :, None] * np.ones(rows.count), atol=1e-9)
    whitened = np.random.default_rng(3).standard_normal((2, 3, rows.count))
    some = rows.on_platform
    back = np.einsum("ijn,ujn->uin", rows.whitener[:, :, some], rows.in_mm(whitened)[..., some])
    np.testing.assert_allclose(back, whitened[..., some], atol=1e-9)
    np.testing.assert_allclose(
        rows.in_mm(whitened[..., some], some), rows.in_mm(whitened)[..., some]
    )


@pytest.mark.long
def test_identify_predicted_uncertainty_is_true(example):
    """A slice of bench/coverage.py: pooled over parameters, 32 trials."""
    model = Model(example("no-effect"))
    frames = fit(model).linear.state
    generator = np.random.default_rng(11)
    pulls = []
    for _ in range(32):
        truth = drawn_from_prior(model, frames, generator)
        found = fit(Model(synthetic_rows(model, truth, generator)))
        count = model.free.size
        pulls.append((found.values[:count] - truth.parameters) / found.sigmas[:count])
    assert np.std(pulls) == pytest.approx(1.0, abs=0.05)
    assert np.std(pulls, axis=0) == pytest.approx(1.0, abs=0.4)


@pytest.mark.long
def test_identify_expected_chi_square_and_floors(simulated):
    """The floors are what a perfect model reaches, on average."""
    fits = [fit(Model(simulated(seed)[0])) for seed in range(25)]
    holds = [hold_out(one) for one in fits]
    assert np.mean([one.chi2_per_dof for one in fits]) == pytest.approx(1.0, abs=0.04)
    fitted = np.mean([one.rms_mm**2 / one.noise_floor_mm**2 for one in fits])
    held = np.mean([one.rms_mm**2 / one.floor_mm**2 for one in holds])
    assert fitted == pytest.approx(1.0, abs=0.04)
    assert held == pytest.approx(1.0, abs=0.05)


def test_identify_holdout_is_what_refitting_without_the_fold_gives(example):
    rows = example("no-effect")
    squares, count = 0.0, 0
    whole = fit(Model(rows))
    for fold in range(5):
        found = fit(Model(rows), masked=list(np.flatnonzero(rows.fold == fold)))
        held = rows.fold == fold
        residual = found.linear.residual[:, held]
        squares, count = squares + float(np.sum(residual**2)), count + int(held.sum())
    assert hold_out(whole).rms_mm == pytest.approx(np.sqrt(squares / count), rel=1e-4)


def test_identify_stray_is_flagged_and_does_not_bend_the_fit(simulated):
    rows, _ = simulated(7)
    clean = fit(Model(rows))
    row = int(np.flatnonzero(rows.on_platform)[40])
    found = fit(Model(changed(rows, row, [0.0, 0.06, 0.03])))
    assert [bad.row for bad in found.bad] == [row]
    assert "stray" in found.bad[0].why
    assert np.all(np.abs(found.values - clean.values) < 0.5 * clean.sigmas)


def test_identify_several_strays_are_all_found(simulated):
    rows, _ = simulated(8)
    wanted = [int(r) for r in np.flatnonzero(rows.on_platform)[[3, 30, 77, 120]]]
    for number, row in enumerate(wanted):
        rows = changed(rows, row, [0.1 * (number + 1), 0.0, -0.1])
    assert sorted(bad.row for bad in fit(Model(rows)).bad) == wanted


@pytest.mark.parametrize("count", [3, 60], ids=["three poses", "a whole pass"])
def test_identify_wrong_hole_is_named(example, count):
    """The SMR sat in nest 4 while the label said 5."""
    rows = example("no-effect")
    names = np.array(rows.nest_name)
    of = {(p, n): i for i, (p, n) in enumerate(zip(rows.pose_name, names, strict=True))}
    poses = [name for name in dict.fromkeys(rows.pose_name) if name][:count]
    position = rows.position.copy()
    for pose in poses:
        position[:, of[pose, "5"]] = rows.position[:, of[pose, "4"]] + 0.004
    found = fit(Model(replace(rows, position=position)))
    assert len(found.bad) == count
    assert {bad.why for bad in found.bad} == {"reads as nest 4, was labelled 5"}
    assert found.chi2_per_dof < 1.3


def test_identify_missing_effect_makes_no_bad_readings(example):
    for name in ("screw-twist-and-heat", "backlash-leg-3", "mystery"):
        assert fit(Model(example(name))).bad == ()


def test_identify_two_runs_share_the_geometry_and_not_the_frame(example):
    from calib.runs.stack import stack

    rows = example("no-effect")
    one = fit(Model(rows))
    two = fit(Model(stack(rows.machine, [rows.runs[0], rows.runs[0]])))
    assert two.model.names[-12:-6] == tuple(
        f"run1.frame.{c}" for c in ("x", "y", "z", "rx", "ry", "rz")
    )
    assert two.readings == 2 * one.readings
    assert np.all(two.sigmas[:54] < one.sigmas[:54])
    np.testing.assert_allclose(
        two.linear.state.frame_position[:, 0], two.linear.state.frame_position[:, 1], atol=1e-9
    )


def test_identify_few_readings_fall_back_on_the_drawing(example):
    rows = example("no-effect")
    poses = [name for name in dict.fromkeys(rows.pose_name) if name][:2]
    found = fit(Model(rows.take([name in poses for name in rows.pose_name])))
    assert found.readings == 6
    assert len(unknown := [p for g in fit_report(found)["unidentified"] for p in g]) > 40, unknown


def test_identify_what_is_left_open_is_said_of_one_and_of_several(example):
    rows = example("no-effect")
    few = fit(Model(rows.take([name in ("", "1", "2", "3") for name in rows.pose_name])))
    whole = fit(Model(rows))
    for found in (few, whole):
        groups = unidentified_groups(found)
        for group, said in zip(groups, unidentified_words(found), strict=True):
            assert ("cannot be told apart" in said) == (len(group) > 1)
            assert ("stays near its drawing value" in said) == (len(group) == 1)
            assert all(name in said for name in group)
    assert {len(group) > 1 for f in (few, whole) for group in unidentified_groups(f)} == {
        True,
        False,
    }


def test_identify_readings_on_a_line_are_refused_in_words(example):
    rows = example("no-effect")
    home = [name in ("b1", "b3") for name in rows.nest_name]
    with pytest.raises(BadInput, match="on one line"):
        fit(Model(rows.take(home)))


def test_identify_another_machines_readings_are_refused_in_words(example):
    rows = example("no-effect")
    generator = np.random.default_rng(0)
    rows = rows.take([name in ("", "1", "2", "3", "4", "5") for name in rows.pose_name])
    wild = replace(
        rows, position=rows.position + 80.0 * generator.standard_normal(rows.position.shape)
    )
    with pytest.raises(BadInput, match="where a nest can be"):
        fit(Model(wild))


def test_identify_verb_answers_json_alone_on_stdout(capsys, tmp_path):
    saved = tmp_path / "model.toml"
    run = str(RUNS / "backlash-leg-3")
    assert pkmcal(["fit", run, "--add", "backlash", "--json", "--save", str(saved)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["format"] == "pkm-fit/1"
    assert answer["effects"] == ["backlash"]
    value = {p["name"]: p for p in answer["parameters"]}["backlash.leg3"]
    assert abs(value["value"] - 0.016877) < 3 * value["sigma"]
    assert pkmcal(["fit", run, "--model", str(saved), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == answer


def test_identify_verb_names_an_unknown_effect(capsys):
    assert pkmcal(["fit", str(RUNS / "no-effect"), "--add", "backlsh"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "backlsh" in captured.err
    assert "backlash" in captured.err
