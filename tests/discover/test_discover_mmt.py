"""The MMT's ladder of pointing terms, climbed by the unchanged core (tests/data/real/README.md)."""

import discover_mmt as mmt
import numpy as np
import pytest

from calib.evidence import diagnose

LADDER = [
    # fitted, RMS in arc seconds, who must come first, share of what is left that it explains
    (["IA", "IE"], 10.51, {"AW"}, 0.67),
    (["IA", "IE", "AN", "AW"], 5.71, {"CA", "NPAE"}, 0.55),
    (["IA", "IE", "AN", "AW", "CA", "NPAE"], 3.83, {"TF"}, 0.87),
    (["IA", "IE", "AN", "AW", "CA", "NPAE", "TF"], 1.37, {"TX"}, 0.54),
]
COMPLETE = ["IA", "IE", "AN", "AW", "CA", "NPAE", "TF", "TX"]


def diagnosis(fitted):
    problem, rms = mmt.problem(fitted)
    found = diagnose(problem, mmt.candidates(fitted), rng=np.random.default_rng(1))
    return found, rms, float(problem.residual @ problem.residual)


@pytest.mark.parametrize(("fitted", "rms", "first", "share"), LADDER)
def test_right_physical_term_ranks_first(fitted, rms, first, share):
    found, reached, chi2 = diagnosis(fitted)
    best = found.findings[0]
    assert reached == pytest.approx(rms, abs=0.005)
    assert best.name in first
    assert best.chi2_fall / chi2 == pytest.approx(share, abs=0.006)
    assert best.p_value < 1e-20
    assert found.best is best


def test_nothing_large_is_left_after_the_ladder():
    found, rms, chi2 = diagnosis(COMPLETE)
    assert rms == pytest.approx(0.93, abs=0.005)
    assert max(each.chi2_fall for each in found.findings) / chi2 < 0.075


def test_harmonic_shows_as_rival_of_tube_flexure():
    found, _, chi2 = diagnosis(COMPLETE[:6])
    rival = found.findings[1]
    assert rival.name == "HECE2"
    assert rival.chi2_fall / chi2 == pytest.approx(0.77, abs=0.006)
    assert rival.p_value < 1e-20


def test_twins_in_collimation_are_reported_as_such():
    found, _, _ = diagnosis(COMPLETE[:4])
    assert any({"CA", "NPAE"} <= set(group) for group in found.indistinguishable)


def test_leave_one_out_of_the_complete_model():
    problem, _ = mmt.problem(COMPLETE)
    leverage = np.sum(problem.absorbed**2, axis=0)
    left_out = mmt.SIGMA * problem.residual / (1.0 - leverage)
    assert np.sqrt(2.0 * np.mean(left_out**2)) == pytest.approx(0.99, abs=0.01)
