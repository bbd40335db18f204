"""A machine without a link: the program asks, a person moves the mock, the tracker measures."""

import asyncio
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from session_mock import POSES, Mock

from app.errors import StoppedByOperator
from app.files.machines import load_machine
from app.files.runs import read_run
from app.files.site import Site, parse_site
from app.session import events as ev
from app.session.links import open_controller
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from calib.identify import fit
from calib.model import Model
from calib.runs.stack import stack
from drivers.canopen import CanopenController
from drivers.errors import DeviceError, NoTarget, Refused
from drivers.kind import ActuatorFacts
from drivers.operator.motors import PersonMoves

OPTIONS = PlanOptions(order="pose-by-pose", warm_up=False, two_face=False)


def by_hand(mock: Mock, folder: Path) -> Site:
    """The mock's site without the link to its controller."""
    text = re.sub(
        r"\[controller\].*?(?=^\[)",
        '[controller]\nkind = "operator"\nserial = "17"\n\n',
        mock.site.to_toml(),
        flags=re.DOTALL | re.MULTILINE,
    )
    return parse_site(text, "site.toml", folder)


class Person:
    """Moves the mock as asked, by its own panel, and answers."""

    def __init__(
        self, panel: CanopenController, says: str = "done", beside_mm: float = 0.0
    ) -> None:
        self.panel, self.says, self.beside_mm = panel, says, beside_mm
        self.session: Session | None = None
        self.asked: list[str] = []
        self._busy: set[asyncio.Task[None]] = set()

    def hear(self, event: ev.Event) -> None:
        if isinstance(event, ev.PromptNeeded):
            task = asyncio.create_task(self._answer(event))
            self._busy.add(task)
            task.add_done_callback(self._busy.discard)

    async def _answer(self, prompt: ev.PromptNeeded) -> None:
        self.asked.append(prompt.text)
        if self.says == "done":
            asked = re.findall(r"q\d = (\S+) mm", prompt.text)
            q = tuple(float(v) + self.beside_mm for v in asked)
            await self.panel.move_to_q(q)
            await self.panel.wait_arrived(30.0)
        says = self.says
        if self.beside_mm:
            says = " ".join(f"{value:.4f}" for value in q)
        assert self.session is not None
        self.session.answer_prompt(prompt.prompt, says)


async def panel_of(mock: Mock) -> CanopenController:
    panel = await open_controller(mock.site)
    assert isinstance(panel, CanopenController)
    await panel.enable()
    return panel


async def test_a_run_is_measured_without_a_link(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    panel = await panel_of(mock)
    person = Person(panel)
    plan = measure_plan(by_hand(mock, tmp_path), POSES, OPTIONS)
    session = person.session = Session.create(by_hand(mock, tmp_path), plan, tmp_path)
    session.observers.watch(person.hear)
    try:
        outcome = await session.run()
    finally:
        await session.close()
        await panel.close()
    assert [text.split(".")[0] for text in person.asked if "Pose a" in text] == ["Pose a"]
    loaded = read_run(outcome.run_folder)
    found = fit(Model(stack(loaded.machine, [loaded.run]), []))
    assert not found.bad
    assert loaded.run.header.controller_serial == "17"


async def test_what_was_really_reached_is_typed_and_goes_into_the_run(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    panel = await panel_of(mock)
    person = Person(panel, beside_mm=0.4)
    site = by_hand(mock, tmp_path)
    session = person.session = Session.create(site, measure_plan(site, POSES, OPTIONS), tmp_path)
    session.observers.watch(person.hear)
    try:
        outcome = await session.run()
    finally:
        await session.close()
        await panel.close()
    loaded = read_run(outcome.run_folder)
    asked = re.findall(r"q1 = (\S+) mm", next(t for t in person.asked if "Pose c" in t))
    rows = [k for k, pose in enumerate(loaded.run.pose) if pose == "c"]
    assert loaded.run.q[0, rows] == pytest.approx(float(asked[0]) + 0.4, abs=1e-4)
    assert np.all(loaded.run.measured[rows])  # the values asked for are no stop on the way
    found = fit(Model(stack(loaded.machine, [loaded.run]), []))
    assert not found.bad


@pytest.mark.parametrize(
    ("typed", "wrong"),
    [
        ("q1=1 q2=2", "or values alone"),
        ("230 231 232", "3 values were typed"),
        ("230 231 232 233 234 nan", '"nan" is no number'),
        ("230,7 231 232 233 234 235", '"230,7" is no number'),
        ("990 230.7 230.7 230.7 230.7 230.7", "outside 195 to 265"),
        ("203.7 230.7 230.7 230.7 230.7 230.7", "a slip of the pen"),
    ],
)
async def test_values_that_cannot_be_are_asked_for_again(typed: str, wrong: str) -> None:
    machine = load_machine("hexapod")
    facts = [ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in machine.actuators]
    person, asked = PersonMoves(facts), list[str]()
    answers = [typed, " ".join(f"{fact.name}=231" for fact in facts)]

    async def ask(text: str, choices: tuple[str, ...], instead: str) -> str:
        asked.append(text)
        return answers[len(asked) - 1]

    person.ask = ask
    await person.enable()
    await person.move_actuators((231.2,) * 6)
    await person.wait_arrived(1.0)
    assert wrong in asked[1]
    assert wrong not in asked[0]
    state = await person.state()
    assert [one.position for one in state.actuators] == [231.0] * 6
    assert not state.moving


@pytest.mark.parametrize(
    ("says", "unattended", "ends"),
    [("cannot be reached", False, Refused), ("done", True, NoTarget)],
)
async def test_a_move_that_nobody_makes_ends_the_run(
    says: str, unattended: bool, ends: type[DeviceError],
    mock_of: Callable[..., Mock], tmp_path: Path,
) -> None:  # fmt: skip
    mock = mock_of("--smrs", "3")
    site = by_hand(mock, tmp_path)
    panel = await panel_of(mock)
    person = Person(panel, says)
    session = person.session = Session.create(
        site, measure_plan(site, POSES, replace(OPTIONS)), tmp_path, unattended=unattended
    )
    session.observers.watch(person.hear)
    try:
        with pytest.raises(ends):
            await session.run()
    finally:
        await session.close()
        await panel.close()
    assert len(person.asked) == (not unattended)


async def test_a_stop_ends_the_waiting_for_a_person(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    site = by_hand(mock, tmp_path)
    session = Session.create(site, measure_plan(site, POSES, OPTIONS), tmp_path)
    asked = asyncio.Event()
    session.observers.watch(lambda e: asked.set() if isinstance(e, ev.PromptNeeded) else None)
    running = session.start()
    try:
        async with asyncio.timeout(60.0):
            await asked.wait()
        await session.stop()
        with pytest.raises(StoppedByOperator):
            await running
    finally:
        await session.close()
