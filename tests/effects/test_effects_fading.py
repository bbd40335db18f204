"""What fades with time has a value for every time constant that a step of a fit may ask for."""

import numpy as np
import pytest
from effects_rows import predicted, readings_of

from calib.effects import effect_named


@pytest.mark.parametrize("name", ["warm-up", "leg-warm-up", "creep", "settling"])
@pytest.mark.parametrize("tau", [0.0, -300.0])
def test_a_time_constant_that_cannot_be_leaves_nothing_of_the_effect(name: str, tau: float) -> None:
    rows = readings_of("hexapod")
    effect = effect_named(name, rows.machine)
    values = np.ones(len(effect.unknowns(rows)))
    there = predicted(rows, effect, np.array([*0.02 * values[:-1], 600.0]))
    gone = predicted(rows, effect, np.array([*0.02 * values[:-1], tau]))
    later = rows.time_s > 0.0
    assert np.abs(there[:, later]).max() > 1e-4
    assert np.all(np.isfinite(gone))
    if name != "creep":  # of it a reading at the moment of a change has lost nothing yet
        np.testing.assert_allclose(gone[:, later], 0.0, atol=1e-9)
