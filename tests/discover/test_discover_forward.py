"""Forward discovery: the staircase goes down, what does not help is refused or taken out."""

from dataclasses import replace

import numpy as np
import pytest
from discover_synthetic import Lab, Refitted

from calib.evidence import diagnose, discover
from calib.evidence.forward import speaks_against


class Refit:
    """Refits linear models of a lab's readings; the hold-out is leave-one-out."""

    def __init__(self, lab, hidden, seed):
        self.lab = lab
        rng = np.random.default_rng(seed)
        self.data = lab.readings(hidden, rng)
        self.asked = []

    def __call__(self, names):
        self.asked.append(names)
        problem = self.lab.fit(self.data)
        for effect in (each for each in self.lab.effects if each.name in names):
            trial = 8 if effect.name == "cyclic" else 0
            problem = problem.with_columns(effect.columns[trial], effect.prior_precision)
        left_out = problem.residual / (1.0 - np.sum(problem.absorbed**2, axis=0))
        others = [each for each in self.lab.effects if each.name not in names]
        found = diagnose(
            problem, others, self.lab.structure, rng=np.random.default_rng(1), draws=199
        )
        return Refitted(names, float(np.sqrt(np.mean(left_out**2))), found)


def hidden(lab, **amplitudes):
    return sum(
        (a * lab.effects[lab.index(name)].columns[0][0] for name, a in amplitudes.items()),
        np.zeros(lab.geometry.shape[1]),
    )


def test_both_effects_are_found_and_the_holdout_falls_with_each_step():
    lab = Lab(21)
    found = discover(Refit(lab, hidden(lab, backlash=3.0, pitch=8.0), 1))
    assert set(found.last.effects) == {"backlash", "pitch"}
    holdouts = [step.stage.holdout for step in found.steps]
    assert holdouts == sorted(holdouts, reverse=True)
    assert found.last.diagnosis.adequate


def test_nothing_hidden_nothing_added():
    lab = Lab(22)
    found = discover(Refit(lab, 0.0, 2))
    assert len(found.steps) == 1
    assert found.last.diagnosis.adequate


def test_unknown_structure_is_not_forced_onto_an_effect():
    lab = Lab(23)
    wave = 5.0 * lab.one(np.sin(2 * np.pi * lab.time / 0.21), 0)
    found = discover(Refit(lab, wave, 3))
    assert found.last.effects == ()
    assert found.last.diagnosis.unexplained.significant
    assert found.last.diagnosis.unexplained.channels[0] == "time_s"


def test_effect_that_makes_the_holdout_rise_is_refused():
    lab = Lab(24)
    refit = Refit(lab, hidden(lab, backlash=3.0), 4)

    def pessimist(names):
        stage = refit(names)
        worse = 5.0 if "backlash" in names else 1.0
        return Refitted(stage.effects, worse * stage.holdout, stage.diagnosis)

    found = discover(pessimist)
    assert "backlash" in found.refused
    assert "backlash" not in found.last.effects
    holdouts = [step.stage.holdout for step in found.steps]
    assert holdouts == sorted(holdouts, reverse=True)


@pytest.mark.parametrize("rise", [0.3, 0.02, 1e-4])
def test_held_out_poses_have_the_veto_however_little_they_object(rise):
    """The effect is really there and the diagnosis calls for it; unseen poses decide."""
    lab = Lab(24)
    refit = Refit(lab, hidden(lab, backlash=3.0), 4)
    before = refit(()).holdout

    def foreseeing(change):
        def stage(names):
            found = refit(names)
            return replace(found, holdout=before * (1.0 + change)) if names else found

        return discover(stage)

    assert foreseeing(rise).last.effects == ()
    assert "backlash" in foreseeing(rise).refused
    assert foreseeing(-rise).last.effects == ("backlash",)
    assert foreseeing(0.0).last.effects == ("backlash",)


def test_effect_made_superfluous_is_taken_out():
    lab = Lab(28)
    refit = Refit(lab, hidden(lab, heat=25.0), 5)
    found = discover(refit, ("heat-twin",))
    assert "heat" in found.last.effects
    assert "heat-twin" in found.last.effects  # the operator put it in: it stays

    def misled(names):
        stage = refit(names)
        if names:
            return stage
        return Refitted((), stage.holdout, misleading(stage.diagnosis))

    def misleading(diagnosis):
        return replace(diagnosis, explained_by=("heat-twin",))

    found = discover(misled)
    assert [step.added for step in found.steps[:3]] == [None, "heat-twin", "heat"]
    assert found.steps[-1].removed == "heat-twin"
    assert found.last.effects == ("heat",)


@pytest.mark.parametrize("seed", range(3))
def test_answer_is_the_same_each_time(seed):
    lab = Lab(30 + seed)
    answers = [discover(Refit(lab, hidden(lab, drift=4.0), seed)) for _ in "ab"]
    assert answers[0].last.effects == answers[1].last.effects
    assert answers[0].last.holdout == answers[1].last.holdout


def test_refused_effect_comes_back_once_another_is_in():
    lab = Lab(21)
    refit = Refit(lab, hidden(lab, backlash=3.0, pitch=8.0), 1)
    first = refit(()).diagnosis.explained_by[0]

    def pessimist(names):
        stage = refit(names)
        return Refitted(names, stage.holdout * (9.0 if names == (first,) else 1.0), stage.diagnosis)

    found = discover(pessimist)
    assert {first} < set(found.last.effects)
    assert found.last.effects[0] != first
    assert found.refused == ()


@pytest.mark.parametrize(
    ("before", "after", "refused"),
    [
        (1.0, 0.9, False),
        (1.0, 1.0, False),
        (1.0, 1.0 + 1e-9, False),
        (1.0, 1.001, True),
        (1.0, np.inf, True),
        (np.inf, np.inf, True),
        (np.nan, np.nan, False),
    ],
)
def test_held_out_poses_decide(before: float, after: float, refused: bool) -> None:
    assert speaks_against(before, after) is refused
