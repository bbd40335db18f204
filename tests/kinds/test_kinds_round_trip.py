"""What is written of a run of version 2 reads back to the same numbers."""

import numpy as np
import pytest

from calib.identify import fit
from calib.model import Model
from calib.runs import format_run, parse_run
from calib.runs.stack import stack
from tests.kinds.conftest import everything
from tests.mechanism.conftest import load


def test_a_run_of_every_kind_is_written_and_read_back() -> None:
    machine = load("delta")
    first = parse_run(*everything(machine, seed=4, poses=4, share=0.2).texts(), actuators=3)
    again = parse_run(*format_run(first), actuators=3)
    assert (again.nest, again.pose) == (first.nest, first.pose)
    np.testing.assert_array_equal(again.q, first.q)
    np.testing.assert_array_equal(again.position, first.position)
    np.testing.assert_allclose(again.covariance, first.covariance, rtol=1e-14)
    for name in ("kind", "seen", "ends"):
        np.testing.assert_array_equal(getattr(again.sensing, name), getattr(first.sensing, name))
    for name in ("axis", "attitude", "spread"):
        np.testing.assert_allclose(
            getattr(again.sensing, name), getattr(first.sensing, name), rtol=1e-12, atol=1e-14
        )
    one, two = (fit(Model(stack(machine, [run]))) for run in (first, again))
    assert two.chi2 == pytest.approx(one.chi2, rel=1e-6)
