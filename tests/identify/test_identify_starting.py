"""Where a fit begins: how far a good reading may be off, and what the base nests say of it."""

from dataclasses import replace

import numpy as np

from calib.identify.starting import aligned, disagreement, slack_of
from calib.model import Model


def begun(rows):
    model = Model(rows)
    base = model.base_points()
    _, linear = aligned(model, base, np.ones(rows.count, dtype=bool))
    return model, base, linear


def test_starting_slack_is_six_sigmas_of_machines_drawn_from_their_tolerances(example):
    """What 2000 machines do to each reading, to first order, and no less than half of them."""
    model, _, linear = begun(example("no-effect"))
    count = model.free.size
    drawn = np.random.default_rng(3).standard_normal((2000, count))
    drawn *= model.machine.prior_sigma[model.free]
    moves = np.einsum("dp,pin->din", drawn, model.rows.in_mm(linear.jacobian[:count]))
    spread = np.sqrt(np.mean(np.sum(moves**2, axis=1), axis=0))
    noise = np.sqrt(np.trace(model.rows.covariance))
    wanted = 1.0 + 6.0 * (np.maximum(spread, np.median(spread)) + noise)
    np.testing.assert_allclose(slack_of(model, linear), wanted, rtol=0.06)
    own = slack_of(model, linear) - 6.0 * noise
    assert np.sum(np.isclose(own, own.min(), rtol=1e-9)) >= 0.5 * own.size - 1.0


def test_starting_slack_grows_by_six_sigmas_of_noise(example):
    """The same machine, its readings four times as uncertain."""
    rows = example("no-effect")
    noisy = replace(rows, covariance=16.0 * rows.covariance)
    (model, _, linear), (other, _, of_other) = begun(rows), begun(noisy)
    more = slack_of(other, of_other) - slack_of(model, linear)
    np.testing.assert_allclose(more, 6.0 * 3.0 * np.sqrt(np.trace(rows.covariance)), rtol=1e-6)


def test_starting_base_nests_that_cannot_tie_a_frame_say_nothing_of_the_machine(example):
    """None, or some on one line: whatever the platform does, nobody knows that it is off."""
    rows = example("no-effect")
    model, base, linear = begun(rows)
    slack = slack_of(model, linear)
    moved = replace(rows, position=rows.position + 50.0 * rows.on_platform)
    off = Model(moved)
    on_a_line = np.flatnonzero(np.isin(rows.nest_name, ["b1", "b3"]))
    platform = np.flatnonzero(rows.on_platform)
    for fixed in ([], on_a_line):
        here = np.array([*platform, *fixed], dtype=int)
        assert disagreement(off, base, here, slack) == 0.0
    everything = np.arange(rows.count)
    assert disagreement(model, base, everything, slack) == 0.0
    assert disagreement(off, base, everything, slack) > 50.0
