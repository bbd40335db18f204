"""One designed follow-up: what an operator does where the first run has not decided."""

import numpy as np

from bench._blind_cases import build_follow_up
from calib.discover.forward import Discovery
from calib.discover.run_design import design_follow_up
from calib.discover.run_discovery import Refitter, discover_run, stage_of
from calib.effects import catalogue
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.run import SimulatedRun

POSES = 10


def in_question(found: Discovery) -> list[str]:
    """Effects between which a first run has not decided: its group, or what it ranks first.

    Empty where it has named an effect and no other will do.
    """
    if len(found.steps) > 1:
        added = found.steps[1].added
        return next((list(g[:2]) for g in found.indistinguishable if added in g), [])
    first = stage_of(found, 0)
    held = first.effects
    return [f.name for f in first.diagnosis.findings if f.name not in held][:1]


def follow_up(
    refit: Refitter, found: Discovery, first: SimulatedRun, hidden: dict[str, float]
) -> tuple[str | None, tuple[tuple[str, ...], ...]]:
    """Design at most ten poses, measure them, discover from both runs: first effect, groups."""
    asked = in_question(found)
    if not asked:
        return found.steps[1].added, tuple(found.indistinguishable)
    fit = stage_of(found, 0).run.fit
    machine = fit.model.machine
    known = {effect.id: effect for effect in catalogue(machine)}
    rng = np.random.default_rng(first.plan.seed)
    plan = design_follow_up(fit, [known[name] for name in asked], POSES, rng)
    second = build_follow_up(first, hidden, plan.poses.task.T, plan.conditions)
    runs = [
        parse_run(run_toml(one), points_csv(one), actuators=len(machine.actuators))
        for one in (first, second)
    ]
    again = discover_run(Refitter(stack(machine, runs), list(known.values())))
    name = again.steps[1].added if len(again.steps) > 1 else None
    return name, tuple(again.indistinguishable)
