"""When a reading is called a stray: as rarely as stated, and as soon as that allows."""

import numpy as np
import pytest
from scipy import stats

from calib.identify.readings import strays

ALARM = 1e-3
"""One run in a thousand that has no stray has a reading flagged."""


def made(readings, unknowns=4, seed=0):
    """Residuals (3, N) of a fit, each reading one sigma long on average, and its derivatives."""
    generator = np.random.default_rng(seed)
    jacobian = generator.normal(size=(unknowns, 3, readings)) / np.sqrt(readings)
    flat = jacobian.reshape(unknowns, -1)
    residual = np.clip(generator.normal(size=(3, readings)), -1.5, 1.5)
    residual *= np.sqrt(3.0 * readings / np.sum(residual**2))
    slope = np.linalg.solve(flat @ flat.T, flat @ residual.reshape(-1))
    return residual - np.tensordot(slope, jacobian, axes=1), jacobian


def missing_by(drop, readings, seed=0):
    """The same with reading 7 so far off that freeing it would lower chi-square by ``drop``."""
    residual, jacobian = made(readings, seed=seed)
    residual[:, 7] = np.sqrt(drop / 3.0)
    return residual, jacobian


def found(residual, jacobian):
    unknowns, _, readings = jacobian.shape
    return strays(residual, jacobian, np.full(unknowns, 1e6), np.ones(readings, dtype=bool))


@pytest.mark.parametrize("readings", [60, 400, 3000])
def test_identify_strays_are_flagged_at_the_stated_false_alarm(readings):
    """Chi-square of three freedoms exceeds the drop in one of so many thousand runs."""

    def drop(alarm):
        return float(3.0 * stats.f.isf(alarm / readings, 3, 3 * readings))

    assert found(*missing_by(drop(0.5 * ALARM), readings)) == [7]
    assert found(*missing_by(drop(2.0 * ALARM), readings)) == []


def test_identify_strays_are_judged_by_the_misfit_of_all_others():
    """Where an effect is missing every reading is off; the same ratio is needed."""
    residual, jacobian = missing_by(60.0, 400)
    assert found(residual, jacobian) == [7]
    bent = 10.0 * residual
    assert found(bent, jacobian) == [7]
    bent[:, 7] = residual[:, 7]
    assert found(bent, jacobian) == []


def test_identify_strays_are_few_or_the_model_is_wrong():
    """Misfit of many readings is no matter of single ones: a tenth is named at most."""
    residual, jacobian = made(200)
    wild = np.arange(50, 75)
    residual[:, wild] *= 10.0 * 1.9 ** np.arange(1, 26)  # each stands out once the worse are gone
    named = found(residual, jacobian)
    assert len(named) == 20
    assert set(named[:15]) <= set(wild[8:])
