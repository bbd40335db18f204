"""Trials of an effect at once are the trials one by one."""

import numpy as np
import pytest
from effects_rows import readings_of

from calib.effects import catalogue
from calib.identify import fit
from calib.identify.signatures import effect_columns
from calib.model import Model


@pytest.mark.parametrize("name", ["hexapod", "delta", "arm"])
def test_effects_scanned_at_once_are_scanned_one_by_one(name):
    fitted = fit(Model(readings_of(name)))
    scanned = []
    for one in effect_columns(fitted, catalogue(fitted.model.machine)):
        if one.effect.scan(one.situation, one.trials[:1]) is None:
            continue
        scanned.append(one.effect.id)
        each = np.stack([one.at(trial) for trial in range(len(one.trials))])
        size = np.abs(each).max()
        assert size > 0.0
        np.testing.assert_allclose(one.some(0, len(one.trials)), each, atol=1e-12 * size)
        np.testing.assert_allclose(one.some(1, 3), each[1:3], atol=1e-12 * size)
    assert {"actuator-step", "frame-shift", "screw-cyclic"} <= set(scanned)
