"""Proposed terms: sparse, stable, and an operator's effect file that the program reads back."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from discover_synthetic import POSES, Lab

from app.files.runs import read_runs
from calib.discover.terms import library, propose
from calib.evidence import Candidate, Columns
from calib.evidence.terms import select_terms
from calib.formulas.effect_file import effect_from_text
from calib.identify import fit
from calib.model import Model
from calib.runs.stack import stack
from calib.unknown import Unknown

RUNS = Path(__file__).parents[1] / "data" / "runs"


def term(name, columns, trials=((),)):
    columns = columns if columns.ndim == 3 else columns[None]
    names = tuple(Unknown(f"{name}.{k}", "mm", 2.0) for k in range(columns.shape[1]))
    return Candidate(name, names, Columns.of(columns), trials)


def offered(lab):
    found = [
        term(f"{axis}{power}", lab.one(values**power, component)[None])
        for axis, values in (("x", lab.x), ("y", lab.y), ("t", lab.time), ("w", lab.warmth))
        for power in (2, 3, 4)
        for component in (0, 1)
    ]
    periods = tuple((p,) for p in np.geomspace(0.1, 0.9, 20))
    waves = np.array(
        [
            [lab.one(shape(2 * np.pi * lab.time / p), 1) for shape in (np.sin, np.cos)]
            for (p,) in periods
        ]
    )
    return [*found, term("wave", waves, periods)]


def selection(lab, hidden, seed):
    rng = np.random.default_rng(seed)
    problem = lab.fit(lab.readings(hidden, rng))
    poses = np.tile(np.arange(POSES), 2)
    library = offered(lab)
    return library, select_terms(problem, library, poses, rng, pairs=6)


def test_two_terms_are_selected_and_stable():
    lab = Lab(41)
    hidden = 9.0 * lab.one(lab.x**3, 0) + 4.0 * lab.one(np.sin(2 * np.pi * lab.time / 0.31), 1)
    library, found = selection(lab, hidden, 1)
    names = [library[one.index].name for one in found if one.stable]
    assert sorted(names) == ["wave", "x3"]
    wave = next(one for one in found if library[one.index].name == "wave")
    assert wave.trial[0] == pytest.approx(0.31, rel=0.08)


def test_noise_gives_no_stable_term():
    stable = []
    for seed in range(12):
        _, found = selection(Lab(60 + seed), 0.0, seed)
        stable.append(sum(one.stable for one in found))
    assert np.mean(stable) <= 0.1


def test_twin_of_a_term_counts_for_it():
    lab = Lab(43)
    lab.warmth = lab.time + 0.001 * np.random.default_rng(0).normal(size=POSES)
    hidden = 25.0 * lab.one(lab.time**2, 0)
    library, found = selection(lab, hidden, 3)
    first = found[0]
    assert library[first.index].name in ("t2", "w2", "t3", "w3")
    assert first.frequency > 0.9


@pytest.fixture(scope="module")
def quadratic():
    """The example run without an effect, screws of legs 2 and 5 changed by k s^2."""
    loaded = read_runs((str(RUNS / "no-effect"),))
    rows = stack(loaded[0].machine, [one.run for one in loaded])
    clean = fit(Model(rows))
    moved = np.zeros((6, rows.count))
    moved[[1, 4]] = 2e-5 * rows.extension[[1, 4]] ** 2
    whitened = np.einsum("ujn,un->jn", clean.linear.situation.actuator_columns, moved)
    shift = rows.in_mm(whitened)
    return fit(Model(dataclasses.replace(rows, position=rows.position + shift)))


@pytest.mark.long
def test_proposal_names_the_hidden_formula(quadratic):
    found = propose(quadratic, np.random.default_rng(1))
    assert found[0].formula == "a * s**2"
    assert found[0].selected.stable
    assert found[0].explains_mm > 0.003


@pytest.mark.long
def test_proposal_is_an_effect_file_that_takes_the_misfit_away(quadratic):
    text = propose(quadratic, np.random.default_rng(1))[0].text
    effect = effect_from_text(text, "found.toml")
    again = fit(Model(quadratic.model.rows, [effect]))
    assert quadratic.chi2_per_dof > 1.2
    assert again.chi2_per_dof < 1.1
    values = again.values[again.model.free.size :][:6]
    assert values[[1, 4]] == pytest.approx([2e-5, 2e-5], rel=0.25)


def test_nothing_is_proposed_for_noise():
    loaded = read_runs((str(RUNS / "no-effect"),))
    clean = fit(Model(stack(loaded[0].machine, [one.run for one in loaded])))
    assert not [one for one in propose(clean, np.random.default_rng(1)) if one.selected.stable]


def test_every_formula_of_the_library_is_a_readable_effect_file(quadratic):
    formulas = library(quadratic)
    assert len(formulas) > 25
    for number, formula in enumerate(formulas):
        effect = effect_from_text(formula.table(f"f-{number}", "a formula", "abc"), "library")
        assert effect.unavailable(quadratic.model.rows) == "", formula.text
