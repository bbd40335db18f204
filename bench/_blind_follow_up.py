"""One designed follow-up: what an operator does where the first run has not decided."""

import numpy as np

from bench._blind_cases import build_follow_up
from calib.discover.design import design_follow_up
from calib.discover.discovery import Refitter, discover_run, stage_of
from calib.effects import catalogue
from calib.evidence.forward import Discovery
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.run import SimulatedRun

POSES = 10
OFFERED = 4
"""Effects that are weighed where nothing was named: those with the most evidence."""

Answer = tuple[str | None, tuple[tuple[str, ...], ...]]


def named(found: Discovery) -> Answer:
    """The effect that a run's first diagnosis names, and the groups that it reports."""
    first = stage_of(found, 0).diagnosis
    groups = dict.fromkeys((*first.indistinguishable, *found.indistinguishable))
    return (first.best.name if first.best else None), tuple(groups)


def questions(found: Discovery) -> list[list[str]]:
    """What a first run has left open: the named one and its rival, or what might be there unseen.

    Empty where an effect was named, no other will do, and the hold-out has accepted it.
    """
    name, groups = named(found)
    if name is not None:
        group = next((list(one[:2]) for one in groups if name in one), [])
        if group or (len(found.steps) > 1 and found.steps[1].added == name):
            return [group] if group else []
        return [[name]]
    first = stage_of(found, 0)
    return [[f.name] for f in first.diagnosis.findings if f.name not in first.effects][:OFFERED]


def follow_up(found: Discovery, first: SimulatedRun, hidden: dict[str, float]) -> Answer:
    """Design at most ten poses, measure them, and diagnose both runs together.

    Of several questions the one is asked to which the poses add most, by the designs' own account.
    """
    asked = questions(found)
    if not asked:
        return named(found)
    fit = stage_of(found, 0).run.fit
    machine = fit.model.machine
    known = {effect.id: effect for effect in catalogue(machine)}
    rng = np.random.default_rng(first.plan.seed)
    plans = [design_follow_up(fit, [known[name] for name in q], POSES, rng) for q in asked]
    plan = max(plans, key=lambda one: one.certainty - min(one.before.values()))
    second = build_follow_up(first, hidden, plan.poses.task.T, plan.conditions)
    runs = [
        parse_run(run_toml(one), points_csv(one), actuators=len(machine.actuators))
        for one in (first, second)
    ]
    return named(discover_run(Refitter(stack(machine, runs), list(known.values()))))
