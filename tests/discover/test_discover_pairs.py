"""Where lines are drawn: two effects told apart, and structure that no known effect explains."""

import numpy as np
import pytest
from discover_synthetic import POSES, Lab

from calib.evidence import Candidate, Columns, Response, Variable, diagnose, structure_candidates
from calib.evidence.bayes import observed
from calib.evidence.pairs import prefers, rivals
from calib.evidence.scores import score
from calib.unknown import Unknown

TOLD_APART = 0.8
"""Probability that the right one of two effects gets more evidence, from which they are told."""


def chance_and_rivals(amplitude, seed):
    """Chance of telling heat from its twin at that size, and whom heat is said not to be told from.

    The readings at hand leave no doubt: what could be told is asked of the size alone.
    """
    lab = Lab(9)
    names = ["heat", "heat-twin"]
    heat, twin = (lab.index(name) for name in names)
    shapes = {index: lab.effects[index].columns[0][0] for index in (heat, twin)}
    problem = lab.fitted(30.0 * shapes[heat], np.random.default_rng(seed))
    scores = score(problem, lab.effects, np.random.default_rng(seed + 100), 199)
    hidden = {index: amplitude * shape for index, shape in shapes.items()}
    told = min(prefers(scores, heat, twin, hidden[heat]), prefers(scores, twin, heat, hidden[twin]))
    return told, rivals(scores, heat, [heat, twin], hidden), twin


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("amplitude", [1.0, 2.0, 3.4, 5.0])
def test_discover_pairs_are_told_apart_in_four_of_five_runs(amplitude, seed):
    told, named, twin = chance_and_rivals(amplitude, seed)
    assert named == ([twin] if told < TOLD_APART else [])


def test_discover_pairs_of_the_test_lie_on_both_sides_of_the_line():
    chances = [chance_and_rivals(a, 0)[0] for a in (1.0, 2.0, 3.4, 5.0)]
    assert chances == sorted(chances)
    assert chances[1] > 0.65
    assert chances[1] < TOLD_APART < chances[2] < 0.92


def test_discover_pairs_that_the_readings_left_undecided_are_named_whatever_was_expected():
    """Odds of less than four to one in these readings are no decision."""
    lab = Lab(9)
    heat, twin = lab.index("heat"), lab.index("heat-twin")
    between = 10.0 * (lab.effects[heat].columns[0][0] + lab.effects[twin].columns[0][0])
    problem = lab.fitted(between, np.random.default_rng(0), sigma=1e-3)
    scores = score(problem, lab.effects, np.random.default_rng(1), 199)
    large = {index: 50.0 * lab.effects[index].columns[0][0] for index in (heat, twin)}
    assert rivals(scores, heat, [heat, twin], large) == [twin]


def lab_with_six(seed):
    """A lab in which heat may also move each fifth of its readings by an amount of its own."""
    lab = Lab(seed)
    heat = lab.effects[lab.index("heat")].columns[0][0]
    parts = np.array([np.where(np.arange(heat.size) % 5 == k, heat, 0.0) for k in range(5)])
    lab.effects.append(lab.effect("heat-apart", parts))
    return lab, heat, parts


def groups(lab, hidden, seed):
    problem = lab.fitted(hidden, np.random.default_rng(seed))
    found = diagnose(problem, lab.effects, rng=np.random.default_rng(seed), draws=199)
    return [names for names in found.indistinguishable if "heat-apart" in names], found


@pytest.mark.parametrize("seed", range(6))
def test_discover_pairs_an_effect_that_holds_another_is_no_rival_of_it_for_nothing(seed):
    lab, heat, _ = lab_with_six(60 + seed)
    named, found = groups(lab, 12.0 * heat, seed)
    assert found.explained_by[0] == "heat"
    assert named == []


def test_discover_pairs_an_effect_that_holds_another_is_named_where_its_own_part_shows():
    lab, _, parts = lab_with_six(60)
    _, found = groups(lab, np.array([14.0, 3.0, 10.0, -4.0, 9.0]) @ parts, 0)
    assert found.explained_by[0] == "heat-apart"


def judged(amplitude, seed):
    """Diagnosis of a lab with a wave in time that no effect of the catalogue makes."""
    lab = Lab(40 + seed)
    generator = np.random.default_rng(seed)
    wave = amplitude * lab.one(np.sin(2.0 * np.pi * lab.time / 0.21), 0)
    problem = lab.fitted(wave, generator)
    return diagnose(problem, lab.effects, lab.structure, lab.quadratic, rng=generator, draws=99)


@pytest.mark.parametrize("seed", range(6))
def test_discover_unknown_structure_beyond_every_effect_is_called_unknown(seed):
    """Evidence of e^25 for a dependence, and no effect that comes near it: nothing is offered."""
    found = judged(2.8, seed)
    evidence = found.unexplained.dependences[0].log_evidence
    assert 20.0 < evidence < 100.0
    assert found.unknown_preferred
    assert found.best is None


def test_discover_unknown_structure_must_beat_the_effects_by_far():
    """The line is at e^10: an effect much larger than it should be is still likelier than nobody's.

    Structure that depends on the same column gets more evidence the larger the effect is.
    """
    put_aside, offered = [], []
    for amplitude in (0.6, 0.75, 1.0, 1.25, 1.5):
        for seed in range(6):
            lab, generator = Lab(60 + seed), np.random.default_rng(seed)
            shape = lab.one(lab.direction[0], 0)
            known = Candidate("play", (Unknown("play", "mm", 0.02),), Columns.of(shape[None, None]))
            axis = Response("axis", lab.one(np.ones(POSES), 0)[None], size=2.0)
            anyhow = structure_candidates(
                [Variable("direction", np.tile(lab.direction[0], 2), (axis,))]
            )
            problem = lab.fitted(amplitude * shape, generator)
            found = diagnose(problem, [known], anyhow, rng=generator, draws=99)
            effect, structure = (observed(found.scores, index)[0] for index in (0, 1))
            beyond = structure - effect
            (put_aside if found.unknown_preferred else offered).append(beyond)
    assert max(offered) > 7.0
    assert max(offered) < 11.0
    assert 9.0 < min(put_aside) < 14.0
