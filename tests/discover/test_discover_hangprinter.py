"""The Hangprinter: accept build-up on the spools, not line flex (tests/data/real/README.md)."""

import discover_hangprinter as hp
import numpy as np
import pytest
from discover_synthetic import Refitted

from calib.evidence import diagnose, discover


@pytest.fixture(scope="module")
def machine():
    return hp.Hangprinter()


@pytest.fixture(scope="module")
def linear_spool(machine):
    return machine.fit(radii=True)


@pytest.fixture(scope="module")
def with_buildup(machine):
    return machine.fit(radii=True, buildup=True)


def diagnosis(machine, found, buildup):
    problem = machine.problem(found)
    candidates = machine.candidates(problem, found, True, buildup)
    return diagnose(problem, candidates, rng=np.random.default_rng(0))


def test_published_residuals_are_reached(machine, linear_spool, with_buildup):
    assert machine.fit(radii=False)[1] == pytest.approx(5.59, abs=0.005)
    assert linear_spool[1] == pytest.approx(2.17, abs=0.005)
    assert with_buildup[1] == pytest.approx(1.03, abs=0.005)
    assert with_buildup[2] - linear_spool[2] == pytest.approx(-262, abs=0.5)


def test_buildup_is_what_is_missing(machine, linear_spool):
    found = diagnosis(machine, linear_spool[0], buildup=False)
    assert found.explained_by == ("buildup",)
    assert found.best.p_value < 1e-20
    estimate = found.best.estimates[0]
    assert estimate.value == pytest.approx(0.094, abs=0.007)
    assert not found.unexplained.significant


def test_line_flex_is_refused(machine, with_buildup):
    found = diagnosis(machine, with_buildup[0], buildup=True)
    assert found.adequate
    flex = next(each for each in found.findings if each.name == "line-flex")
    assert flex.p_value > 0.5
    assert flex.log_evidence < 0
    assert 0.0 < flex.estimates[0].value < flex.estimates[0].sigma  # and of the wrong sign


def test_discovery_stops_after_the_buildup(machine, linear_spool, with_buildup):
    def refit(effects):
        fitted = with_buildup[0] if "buildup" in effects else linear_spool[0]
        problem = machine.problem(fitted)
        free = 1.0 - np.sum(problem.absorbed**2, axis=0)
        seen = free > 1e-6  # a line without which its pose is not determined predicts nothing
        left_out = problem.residual[seen] / free[seen]
        found = diagnosis(machine, fitted, "buildup" in effects)
        return Refitted(effects, float(np.sqrt(np.mean(left_out**2))), found)

    found = discover(refit)
    assert [step.added for step in found.steps] == [None, "buildup"]
    assert found.last.holdout < 0.7 * found.steps[0].stage.holdout
    assert found.last.diagnosis.adequate


def test_coefficient_and_its_uncertainty(with_buildup):
    fitted = with_buildup[0]
    covariance = np.linalg.inv(fitted.jac.T @ fitted.jac) * with_buildup[1] ** 2
    assert fitted.x[16] == pytest.approx(0.094, abs=0.001)
    assert np.sqrt(covariance[16, 16]) == pytest.approx(0.007, abs=0.0005)
