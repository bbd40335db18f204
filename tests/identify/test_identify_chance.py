"""Tails of distributions against scipy's own, far out too, and the bound that spares them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from calib import chance

FREEDOMS = (1.0, 2.0, 3.0, 7.5, 60.0, 1234.5)
TINY = 1e-290
"""Below this a probability is at the end of the numbers, and no digits are left to compare."""


@pytest.mark.parametrize("dof", FREEDOMS)
def test_tails_of_chi_square_are_scipys(dof: float) -> None:
    chi2 = dof * np.geomspace(1e-3, 1e3, 200)
    true = stats.chi2.sf(chi2, dof)
    seen = true > TINY
    np.testing.assert_allclose(chance.chi2_above(dof, chi2)[seen], true[seen], rtol=1e-12)
    for one in chi2[::20]:
        assert chance.chi2_below(dof, float(one)) == pytest.approx(
            stats.chi2.cdf(one, dof), rel=1e-12, abs=TINY
        )


@pytest.mark.parametrize("own", [1, 2, 3])
@pytest.mark.parametrize("others", [1.0, 8.3, 250.0])
def test_tails_of_f_are_scipys(own: int, others: float) -> None:
    for ratio in np.geomspace(1e-3, 1e6, 60):
        true = stats.f.sf(ratio, own, others)
        if true > TINY:
            assert chance.f_above(own, others, float(ratio)) == pytest.approx(true, rel=1e-12)


@given(st.integers(1, 3), st.floats(1.0, 5000.0), st.floats(1e-3, 1e4))
def test_the_bound_is_never_above_the_tail(own: int, others: float, ratio: float) -> None:
    bound = chance.f_above_at_least(own, others, ratio)
    assert 0.0 <= bound <= chance.f_above(own, others, ratio) * (1.0 + 1e-9) + TINY


@given(st.integers(1, 3), st.floats(1.0, 5000.0), st.floats(1e-3, 1e3), st.floats(-12.0, 0.0))
def test_what_is_rarer_is_what_the_tail_says(
    own: int, others: float, ratio: float, decades: float
) -> None:
    than = 10.0**decades
    said = chance.f_rarer_than(than, own, others, ratio)
    assert said == (chance.f_above(own, others, ratio) <= than)


def test_the_normals_and_poissons_tails_are_scipys() -> None:
    z = np.linspace(-40.0, 8.0, 97)
    np.testing.assert_allclose(chance.log_normal_below(z), stats.norm.logcdf(z), rtol=1e-12)
    for count, mean in ((1, 1e-9), (2, 0.3), (5, 20.0)):
        assert chance.poisson_at_least(count, mean) == pytest.approx(
            stats.poisson.sf(count - 1, mean), rel=1e-12
        )


@pytest.mark.parametrize("dof", [0.3, 1.0, 7.5, 121.3, 36000.5])
def test_one_tail_is_scipy_s_and_never_underflows(dof: float) -> None:
    for sigmas in (-4.0, -1.0, 0.0, 0.5, 1.01, 3.0, 30.0):
        chi2 = dof + sigmas * math.sqrt(2.0 * dof)
        if chi2 > 0.0:
            assert chance.log_chi2_above(dof, chi2) == pytest.approx(
                stats.chi2.logsf(chi2, dof), rel=1e-8, abs=1e-9
            )
    assert chance.log_chi2_above(dof, 1e6) < -3e5
    assert chance.log_chi2_above(dof, 0.0) == 0.0
