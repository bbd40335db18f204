"""What leaves its prior, or the range in which it was looked for, is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.files.runs import read_run
from calib.effects import effect_named
from calib.identify import Fit
from calib.identify.beyond import beyond_words
from calib.identify.staged import fit_effects
from calib.runs.stack import stack

RUN = Path(__file__).parents[1] / "data" / "runs" / "no-effect"


@pytest.fixture(scope="module")
def fitted() -> Fit:
    loaded = read_run(RUN)
    rows = stack(loaded.machine, [loaded.run])
    return fit_effects(
        rows, [effect_named(n, loaded.machine) for n in ("backlash", "screw-cyclic")]
    )


def moved(fitted: Fit, name: str, value: float) -> Fit:
    """The same fit, had it come to another value of one unknown."""
    state, effects = fitted.linear.state, []
    for group, values in zip(fitted.model.unknowns, fitted.linear.state.effects, strict=True):
        named = np.array([unknown.name == name for unknown in group])
        effects.append(np.where(named, value, values))
    linear = replace(fitted.linear, state=replace(state, effects=tuple(effects)))
    return replace(fitted, linear=linear)


def test_nothing_is_said_of_what_stays_where_it_is_expected(fitted: Fit) -> None:
    assert beyond_words(fitted) == []


def test_a_size_far_beyond_its_prior_is_said_with_both(fitted: Fit) -> None:
    (said,) = beyond_words(moved(fitted, "backlash.leg2", -6.0))
    assert said.startswith("backlash.leg2 = -6.0")
    assert "mm that is expected of it" in said


def test_a_period_outside_of_its_range_is_said(fitted: Fit) -> None:
    (said,) = beyond_words(moved(fitted, "screw-cyclic.period", 440.0))
    assert said.startswith("screw-cyclic.period = 440.0")
    assert "in which it was looked for" in said
