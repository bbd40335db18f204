"""What the core says about itself is true: false alarms, power, intervals, pairs, visibility."""

import numpy as np
import pytest
from discover_synthetic import POSES, Lab
from scipy import special, stats

from calib.evidence import LinearProblem, diagnose, fill_missing
from calib.evidence.diagnosis import DRAWS
from calib.evidence.draws import residuals_of
from calib.evidence.pairs import power, prefers
from calib.evidence.tails import log_tail
from calib.evidence.weighing import chi_squares

pytestmark = pytest.mark.long
SEED = 20


def signature(lab, name, amplitude, unknown=0, trial=0):
    return amplitude * lab.effects[lab.index(name)].columns[trial][unknown]


def judged(lab, hidden, rng, sigma=1.0, structure=True):
    problem = lab.fitted(hidden, rng, sigma)
    if not structure:
        return diagnose(problem, lab.effects, rng=rng, draws=199)
    return diagnose(problem, lab.effects, lab.structure, lab.quadratic, rng=rng, draws=199)


def test_false_alarms_are_five_percent():
    rng = np.random.default_rng(SEED)
    alarms = sum(not judged(Lab(seed), 0.0, rng).adequate for seed in range(300))
    assert 0.016 <= alarms / 300 <= 0.084  # 5 % +- 2.7 sigmas


def test_readings_that_scatter_more_than_stated_are_no_effect():
    rng = np.random.default_rng(SEED + 1)
    found = [judged(Lab(seed), 0.0, rng, sigma=1.3) for seed in range(60)]
    assert np.mean([not one.adequate for one in found]) < 0.2
    assert np.mean([one.scatter for one in found]) == pytest.approx(1.69, abs=0.1)


@pytest.mark.parametrize(("name", "amplitude"), [("backlash", 0.6), ("cyclic", 0.8), ("heat", 1.8)])
def test_predicted_power_is_observed(name, amplitude):
    lab = Lab(3)
    hidden = signature(lab, name, amplitude, trial=8 if name == "cyclic" else 0)
    rng = np.random.default_rng(SEED + 2)
    predicted, observed = [], []
    index = lab.index(name)
    for run in range(120):
        found = judged(lab, hidden, rng)
        if run < 20:
            predicted.append(power(found.scores, found.family, index, hidden))
        observed.append(next(each for each in found.findings if each.name == name).p_value <= 0.05)
    assert 0.15 < np.mean(observed) < 0.97
    assert np.mean(predicted) == pytest.approx(np.mean(observed), abs=0.12)  # 2.7 sigmas of 120


def test_power_grows_with_size():
    lab = Lab(4)
    found = judged(lab, 0.0, np.random.default_rng(SEED))
    sizes = [
        power(found.scores, found.family, 1, signature(lab, "backlash", a)) for a in (0.0, 0.6, 3.0)
    ]
    assert sizes[0] < 0.05
    assert sizes[0] < sizes[1] < sizes[2]
    assert sizes[2] > 0.99


@pytest.mark.parametrize("name", ["pitch", "backlash", "heat", "drift", "cyclic"])
def test_right_effect_comes_first(name):
    rng = np.random.default_rng(SEED + 3)
    first = []
    for seed in range(30):
        lab = Lab(seed)
        trial = 9 if name == "cyclic" else 0
        hidden = signature(lab, name, 1.0, trial=trial)
        hidden *= 9.0 / np.linalg.norm(lab.fitted(0.0, rng).project(hidden))
        found = judged(lab, hidden, rng)
        together = [name, *(n for g in found.indistinguishable if name in g for n in g)]
        first.append(found.findings[0].name in together)
    assert np.mean(first) >= 0.95


def test_one_leg_alone_is_recognised():
    lab = Lab(6)
    found = judged(lab, signature(lab, "backlash", 2.5, unknown=1), np.random.default_rng(SEED))
    assert found.best.name == "backlash"
    assert found.best.acting == ("backlash.1",)


def test_period_is_found_though_it_lies_between_two_trials():
    lab = Lab(7)
    period = 1.0 / 3.12
    hidden = 6.0 * lab.one(np.sin(2 * np.pi * lab.x / period), 0)
    found = judged(lab, hidden, np.random.default_rng(SEED))
    assert found.best.name == "cyclic"
    assert found.best.trial[0] == pytest.approx(period, rel=0.1)
    assert found.explained_by == ("cyclic",)
    assert not found.unexplained.significant


def test_intervals_hold_what_they_promise():
    rng = np.random.default_rng(SEED + 4)
    inside, pulls = [], []
    for seed in range(300):
        lab = Lab(seed)
        found = judged(lab, signature(lab, "pitch", 1.5), rng, structure=False)
        estimate = next(each for each in found.findings if each.name == "pitch").estimates[0]
        pulls.append((estimate.value - 1.5) / estimate.sigma)
        inside.append(abs(pulls[-1]) < 1.0)
    assert np.mean(inside) == pytest.approx(0.683, abs=0.075)
    assert np.mean(pulls) == pytest.approx(0.0, abs=0.16)


def test_two_hidden_effects_are_both_named():
    rng = np.random.default_rng(SEED + 5)
    named = []
    for seed in range(30):
        lab = Lab(seed)
        hidden = signature(lab, "backlash", 2.0, unknown=1) + signature(lab, "pitch", 6.0)
        named.append(set(judged(lab, hidden, rng).explained_by) == {"backlash", "pitch"})
    assert np.mean(named) >= 0.85


def test_unknown_effect_is_declared_unknown_with_its_variable():
    rng = np.random.default_rng(SEED + 6)
    declared, channels = [], []
    for seed in range(30):
        lab = Lab(seed)
        hidden = 3.0 * lab.one(np.sin(2 * np.pi * lab.time / 0.3), 1)
        found = judged(lab, hidden, rng)
        declared.append(found.unexplained.significant and not found.adequate)
        channels.append(found.unexplained.channels[:1] == ("time_s",))
    assert np.mean(declared) >= 0.95
    assert np.mean(channels) >= 0.9


def test_twins_are_reported_and_strangers_are_not():
    lab = Lab(8)
    lab.warmth = lab.time + 1e-4 * np.random.default_rng(0).normal(size=POSES)
    lab.effects[2] = lab.effect("heat", lab.one(lab.warmth * lab.x, 0)[None])
    found = judged(lab, signature(lab, "heat", 8.0), np.random.default_rng(SEED))
    assert [set(group) for group in found.indistinguishable] == [{"heat", "heat-twin"}]
    far = judged(lab, signature(lab, "backlash", 3.0), np.random.default_rng(SEED))
    assert far.indistinguishable == ()


def test_predicted_preference_is_observed():
    lab = Lab(9)
    heat, twin = lab.index("heat"), lab.index("heat-twin")
    hidden = signature(lab, "heat", 3.0)
    rng = np.random.default_rng(SEED + 7)
    predicted = prefers(judged(lab, 0.0, rng).scores, heat, twin, hidden)
    won = []
    for _ in range(200):
        ranks = [each.index for each in judged(lab, hidden, rng, structure=False).findings]
        won.append(ranks.index(heat) < ranks.index(twin))
    assert predicted == pytest.approx(np.mean(won), abs=0.12)


def test_same_seed_same_answer():
    lab = Lab(2)
    problem = lab.fitted(signature(lab, "drift", 2.0), np.random.default_rng(1))
    answers = [
        diagnose(problem, lab.effects, lab.structure, rng=np.random.default_rng(7)) for _ in "ab"
    ]
    assert [f.p_value for f in answers[0].findings] == [f.p_value for f in answers[1].findings]


def test_null_draws_have_the_covariance_of_the_residual():
    lab = Lab(1)
    problem = lab.fitted(0.0, np.random.default_rng(2))
    draws = residuals_of(problem, 20000, np.random.default_rng(3)).array()[:, 1:]
    weight = np.eye(problem.rows) - problem.absorbed.T @ problem.absorbed
    np.testing.assert_allclose(np.cov(draws), weight, atol=0.05)
    assert DRAWS % 20 == 19  # so that 5 % is a whole number of draws


def test_visible_is_a_ratio_of_norms_without_priors():
    jacobian = np.eye(3)[:2] * [[1e-6], [1.0]]
    problem = LinearProblem(np.zeros(3), jacobian, np.array([1.0, 1.0]))
    assert problem.visible(np.array([[3.0, 0.0, 4.0]])) == pytest.approx(0.8)
    assert problem.visible(np.array([[1.0, 1.0, 0.0]])) == pytest.approx(0.0, abs=1e-7)
    assert problem.visible(np.zeros((1, 3))) == 0.0


def test_filled_rows_equal_rows_left_out():
    lab = Lab(5)
    data = lab.readings(0.0, np.random.default_rng(4))
    missing = np.zeros(data.size, dtype=bool)
    missing[[3, 11, 50]] = True
    whole, left = lab.fit(data), lab.fit(data, ~missing)
    own = lab.effects[1].columns[0]
    columns, kept = fill_missing(whole, own, missing), own[:, ~missing]
    np.testing.assert_allclose(columns @ whole.residual, kept @ left.residual, atol=1e-6)
    np.testing.assert_allclose(
        columns @ whole.project(columns).T, kept @ left.project(kept).T, rtol=1e-6
    )


def test_directions_that_hardly_move_the_readings_cost_nothing():
    lab = Lab(15)
    rng = np.random.default_rng(9)
    faint = 0.01 * rng.normal(size=(9, lab.geometry.shape[1]))
    columns = np.concatenate([lab.one(lab.x**3, 0)[None], faint])
    crowd = lab.effect("crowd", columns)
    hidden = 3.0 * columns[0] * 9.0 / np.linalg.norm(lab.fitted(0.0, rng).project(columns[0]))
    one = lab.effect("one", columns[:1])
    found = diagnose(lab.fitted(hidden / 6.0, rng), [crowd, one], rng=rng, draws=199)
    whole = found.scores.weighed.weighing(0, 0)
    fall = chi_squares(whole, found.scores.scores[0][:, :, :1])[0, 0]
    blunt = -log_tail(np.array([fall]), int(whole.dof[0]))[0]
    crowded, alone = (level[0] for level in found.scores.levels)
    assert whole.dof[0] == 10
    assert crowded > blunt + 1.0
    assert crowded > alone - 1.5


@pytest.mark.parametrize("dof", [3, 300, 3000, 40_000])
def test_tails_of_many_freedoms_are_the_integral_and_never_underflow(dof):
    for share in (1.0, 1.2, 1.5, 2.0, 3.0):
        a, x = 0.5 * dof, 0.5 * dof * share
        beyond = np.geomspace(1e-9, 1.0, 100_001) * (60.0 * np.sqrt(x) + 800.0)
        log_density = (a - 1.0) * np.log1p(beyond / x) - beyond
        top = log_density.max()
        integral = np.trapezoid(np.exp(log_density - top), beyond)
        wanted = (a - 1.0) * np.log(x) - x - special.gammaln(a) + top + np.log(integral)
        with np.errstate(all="raise", under="ignore"):
            assert log_tail(np.array([2.0 * x]), dof)[0] == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("dof", [1, 2, 5, 24])
def test_tails_agree_with_scipy_and_go_on_where_it_underflows(dof):
    values = np.array([0.0, 0.5, 3.0, 20.0, 150.0, 600.0, 1200.0])
    np.testing.assert_allclose(
        log_tail(values, dof), stats.chi2.logsf(values, dof), rtol=1e-3, atol=1e-4
    )
    far = log_tail(np.array([1200.0, 5000.0, 20000.0]), dof)
    slope = np.diff(far) / np.array([3800.0, 15000.0])
    assert np.all(np.isfinite(far))
    assert slope == pytest.approx([-0.5, -0.5], abs=0.5 * dof / 1200 + 2e-3)
