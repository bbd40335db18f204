"""Laws of readings of every kind, on every machine that ships."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from calib.discover.compare import compare_fit
from calib.discover.compare_report import compare_report
from calib.identify import fit
from calib.model import Model
from calib.runs.sensing import KINDS
from tests.kinds.conftest import everything, rows_of
from tests.mechanism.conftest import load

SHIPPED = sorted(
    entry.name.removesuffix(".toml")
    for entry in files("calib.machines").iterdir()
    if entry.name.endswith(".toml")
)


@pytest.fixture(scope="module", params=SHIPPED)
def found(request):
    """A machine, and a fit to readings without noise."""
    machine = load(request.param)
    lab = everything(machine, seed=3, noise=0.0, share=0.2)
    return machine, lab, fit(Model(rows_of(machine, lab)))


def test_every_kind_is_there(found) -> None:
    _, _, fitted = found
    assert set(fitted.model.rows.sensed.kind) == set(range(len(KINDS)))


def test_readings_without_noise_are_explained_exactly(found) -> None:
    _, _, fitted = found
    assert not fitted.bad
    assert np.sqrt(fitted.chi2 / fitted.components) < 0.2  # what priors pull
    setup = [fitted.model.names.index(one.name) for one in fitted.model.setup.unknowns]
    off = (fitted.values - fitted.model.centre)[setup] / fitted.model.prior[setup]
    assert np.all(np.abs(off) < 5.0)


def test_derivatives_are_those_of_differences(found) -> None:
    """By every unknown: geometry, setup, frames; components that are not held stay at zero."""
    _, _, fitted = found
    model, state, linear = fitted.model, fitted.linear.state, fitted.linear
    dead = ~model.rows.live
    assert not linear.jacobian[:, dead].any()
    assert not linear.whitened[dead].any()
    for move in directions(model):
        ahead = model.linearise(model.moved(state, move)).whitened
        back = model.linearise(model.moved(state, -move)).whitened
        expected = np.tensordot(move, linear.jacobian, axes=1)
        scale = np.abs(expected).max() + 1e-6
        named = [name for name, part in zip(model.names, move, strict=True) if part]
        assert np.abs(0.5 * (back - ahead) - expected).max() < 5e-4 * scale, named[:3]


def directions(model: Model):
    """Steps of geometry and of each frame, each at random; of each unknown of the setup alone."""
    rng = np.random.default_rng(1)
    count, setup = model.free.size, len(model.setup.unknowns)
    groups = [np.arange(count)] * 3 + [np.array([count + k]) for k in range(setup)]
    groups += [count + setup + 6 * k + np.arange(6) for k in range(model.frames)]
    size = np.where(np.isfinite(model.prior), 1e-2 * model.prior, 1e-3)
    size[count + setup :] = np.tile([1e-2] * 3 + [1e-5] * 3, model.frames)
    for group in groups:
        move = np.zeros(size.size)
        move[group] = size[group] * rng.choice([-1.0, 1.0], group.size)
        yield move


def test_chi_square_is_its_degrees_of_freedom(hexapod) -> None:
    """Seeds 11 to 16: the mean of chi-square over its freedom is one within what draws give."""
    ratios, off = [], []
    for seed in range(11, 17):
        lab = everything(hexapod, seed=seed)
        fitted = fit(Model(rows_of(hexapod, lab)))
        assert not fitted.bad
        ratios.append(fitted.chi2 / fitted.dof)
        free = fitted.model.free
        off.append((fitted.values[: free.size] - lab.parameters[free]) / fitted.sigmas[: free.size])
    spread = np.sqrt(2.0 / fitted.dof / len(ratios))
    assert np.mean(ratios) == pytest.approx(1.0, abs=4.0 * spread)
    assert np.mean(np.square(off)) == pytest.approx(1.0, abs=0.35)


def test_a_vague_component_says_as_little_as_a_missing_one(hexapod) -> None:
    """z alone, and z beside x and y by a metre, are the same reading."""
    found = []
    for vague in (0.0, 1000.0):
        lab = everything(hexapod, seed=5, noise=0.0, poses=8)
        lab.rows.clear()
        lab.header["instruments"] = {"probe": {"frame": "base"}}
        for k in range(8):
            lab.go(f"{k}", lab.q[:, k].tolist(), lab.place, lab.turn)
            lab.point("p1", 0.01, by="probe", only="z", vague=vague)
        rows = rows_of(hexapod, lab)
        model = Model(rows)
        found.append(model.linearise(model.start(np.zeros((3, 3, 0)), np.zeros((3, 0)))))
        if vague:
            assert rows.in_millimetres[:2].sum() == 0
    assert found[0].whitened[2] == pytest.approx(found[1].whitened[2], abs=1e-9)
    assert replace(found[0]).jacobian[:, 2] == pytest.approx(found[1].jacobian[:, 2], abs=1e-9)


def test_nests_that_are_next_to_exact_make_nothing_else_vague(hexapod) -> None:
    lab = everything(hexapod, seed=5, noise=0.0)
    for row in lab.rows:
        if row["nest"] in ("b1", "b2", "b3") and row["kind"] == "point":
            row |= dict.fromkeys(("sx", "sy", "sz"), 1e-6)
    rows = rows_of(hexapod, lab)
    plain = rows.placed & rows.on_platform
    assert plain.sum() >= 18
    fitted = fit(Model(rows))
    compare_report(compare_fit(fitted, np.random.default_rng(0)))
    assert 1000.0 * fitted.noise_floor_mm < 30.0
