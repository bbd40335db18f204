"""Kinds of steps: each trait holds for every kind that has it, and for no other."""

import asyncio
import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from session_mock import POSES, Heard, site_text

from app.errors import GateRefused
from app.files.site import Site, parse_site
from app.session import events as ev
from app.session import kinds
from app.session.journal import Journal
from app.session.kinds import KINDS, StepKind
from app.session.plan import Plan, PlanWriter
from app.session.plans import PlanOptions, measure_plan
from app.session.routines import ROUTINES
from app.session.session import Session
from calib.errors import BadInput
from drivers.errors import DeviceError

ARGUMENTS = {
    "pose": "a", "nest": "3", "smr": 1, "of": "a", "pose2": "a", "minutes": 5.0,
    "poses": ["b", "a"],
}  # fmt: skip


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return parse_site(site_text(smrs=3), "site.toml", tmp_path)


@pytest.fixture
def plan() -> Plan:
    """One step of each kind."""
    writer = PlanWriter()
    for kind in KINDS.values():
        writer.add(kind, **ARGUMENTS)
    return Plan("measure", "one of each", "hexapod", {"a": POSES["a"]}, tuple(writer.steps))


def all_done(journal: Journal, plan: Plan) -> None:
    for step in plan.steps:
        journal.done(step.id, 1, 1.0, "now", {})


def kinds_of(steps: list) -> set[StepKind]:
    return {step.kind for step in steps}


def test_every_kind_has_its_routine() -> None:
    assert set(ROUTINES) == set(KINDS.values())


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_words_and_goal_come_from_the_steps_own_arguments(kind: StepKind, plan: Plan) -> None:
    step = next(step for step in plan.steps if step.kind is kind)
    assert step.says
    assert "{" not in step.says
    assert step.goal == {"nowhere": None, "home": "home", "pose": "a", "round": "a"}[kind.moves_to]


def test_steps_that_rest_on_readings_are_due_again_when_readings_are_set_aside(
    site: Site, plan: Plan, tmp_path: Path
) -> None:
    session = Session.create(site, plan, tmp_path)
    all_done(session.journal, plan)
    assert session.due() == []
    session.work.start_over("the stand was moved")
    assert kinds_of(session.due()) == {k for k in KINDS.values() if k.rests_on_readings}
    assert kinds.READ.rests_on_readings


def test_steps_that_are_done_every_time_are_due_once_in_a_session_taken_over(
    site: Site, plan: Plan, tmp_path: Path
) -> None:
    first = Session.create(site, plan, tmp_path)
    all_done(first.journal, plan)
    first.journal.close()
    again = Session.reopen(first.folder)
    every_time = [step for step in plan.steps if step.kind.every_time]
    assert again.due() == every_time
    for step in every_time:
        again.journal.started(step.id, 2, 2.0, "now")
        assert step in again.due()
        again.journal.done(step.id, 2, 3.0, "now", {})
    assert again.due() == []


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
async def test_a_step_in_work_is_left_out_unless_safety_needs_it(
    kind: StepKind, site: Site, plan: Plan, tmp_path: Path, heard: Heard
) -> None:
    step = next(step for step in plan.steps if step.kind is kind)
    session = Session.create(site, replace(plan, steps=(step,)), tmp_path, unattended=True)
    refused: list[GateRefused] = []

    def skip() -> None:
        try:
            session.skip("in a hurry")
        except GateRefused as error:
            refused.append(error)

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.StepStarted):
            asyncio.get_running_loop().call_soon(skip)

    session.observers.watch(heard)
    session.observers.watch(hear)
    with suppress(DeviceError):  # nobody answers at this site
        await session.run()
    assert bool(refused) is not kind.skippable
    assert [event.why for event in heard.of(ev.StepSkipped)] == ["in a hurry"] * kind.skippable


def test_what_no_journal_holds_is_done_every_time() -> None:
    """Who answers, whether the path is free, a ready tracker and drives that hold the machine."""
    every_time = {kind.name for kind in KINDS.values() if kind.every_time}
    assert every_time == {"connect", "check-path", "tracker", "gauge", "drives"}


def test_what_safety_needs() -> None:
    needed = {kind.name for kind in KINDS.values() if not kind.skippable}
    assert needed == {"connect", "check-path", "tracker", "gauge", "drives", "apart", "rest"}


def stored_plan(site: Site) -> dict:
    return json.loads(measure_plan(site, POSES, PlanOptions()).to_json())


def test_a_kind_is_stored_as_its_word(site: Site) -> None:
    steps = stored_plan(site)["steps"]
    assert steps[0] == {
        "id": "0001-connect", "kind": "connect",
        "says": "identities and the controller's parameters", "args": {},
    }  # fmt: skip
    assert all(step["kind"] in KINDS for step in steps)


@pytest.mark.parametrize("kind", ["levitate", 7, None])
def test_a_stored_kind_that_is_unknown_is_named_with_what_to_do(site: Site, kind: object) -> None:
    plan = stored_plan(site)
    plan["steps"][3]["kind"] = kind
    with pytest.raises(BadInput, match=r"plan\.json.*unknown kind.*version of pkmcal") as bad:
        Plan.from_json(json.dumps(plan), "plan.json")
    assert repr(kind) in bad.value.what


def test_a_stored_move_without_its_pose_is_no_plan(site: Site) -> None:
    plan = stored_plan(site)
    move = next(step for step in plan["steps"] if step["kind"] == "move")
    move["args"] = {}
    with pytest.raises(BadInput, match=r"plan\.json.*pose"):
        Plan.from_json(json.dumps(plan), "plan.json")


def test_a_plan_reads_back_with_the_same_records(plan: Plan) -> None:
    back = Plan.from_json(plan.to_json(), "plan.json")
    assert back == replace(plan, steps=back.steps)
    assert all(a.kind is b.kind for a, b in zip(back.steps, plan.steps, strict=True))
