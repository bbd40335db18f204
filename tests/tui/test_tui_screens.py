"""Every screen and dialog at both sizes, as it looks: fixed theme, fixed events."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import tui_stream as stream
from textual.pilot import Pilot

from app.session.events import WriteBackStage
from app.tui.program import FACES, SIDES, Workbench
from app.tui.watching import Watching

SIZES = [(80, 24), (160, 48)]


@pytest.fixture
def utc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Clocks of these pictures show UTC, wherever they are taken."""
    with monkeypatch.context() as there:
        there.setenv("TZ", "UTC")
        time.tzset()
        yield
    time.tzset()


Look = Callable[..., bool]


async def full(pilot: Pilot[Any], folder: Path) -> Workbench:
    """The program with something to show on every screen."""
    bench = pilot.app
    assert isinstance(bench, Workbench)
    await stream.put_up(bench, folder)
    desk = bench.desk
    desk.study.answer = stream.fitted()
    desk.automatic.show(stream.flown(folder / "auto-20261122-0800"))
    desk.study.search = stream.searched()
    desk.course.before, desk.course.after = stream.verified(600.0, 1), stream.verified(5.0, 2)
    desk.corrections.comparison = stream.compared()
    desk.corrections.snapshots = stream.snapshots()
    desk.corrections.in_use = frozenset({2})
    for gate in stream.compared().gates:
        desk.picture.tell(gate)
    desk.picture.tell(WriteBackStage("write", "54 values into volatile memory"))
    desk.picture.tell(WriteBackStage("read-back", "every value reads back bit for bit"))
    return bench


@pytest.mark.parametrize("size", SIZES, ids=["80x24", "160x48"])
@pytest.mark.parametrize("number", range(1, len(FACES) + 1), ids=[face.mode for face in FACES])
def test_screen(snap_compare: Look, tmp_path: Path, number: int, size: tuple[int, int]) -> None:
    async def show(pilot: Pilot[Any]) -> None:
        await full(pilot, tmp_path)
        await pilot.press(str(number))
        await pilot.pause(0.5)

    assert snap_compare(Workbench(root=tmp_path), terminal_size=size, run_before=show)


@pytest.mark.parametrize("size", SIZES, ids=["80x24", "160x48"])
@pytest.mark.parametrize("mode", [face.mode for face in SIDES])
def test_side_screen(
    snap_compare: Look, tmp_path: Path, mode: str, size: tuple[int, int], utc: None
) -> None:
    stream.remember(tmp_path)

    async def show(pilot: Pilot[Any]) -> None:
        bench = await full(pilot, tmp_path)
        bench.desk.watched = Watching(stream.begun_elsewhere(tmp_path))
        bench.action_show_side(mode)
        await pilot.pause(1.2)

    assert snap_compare(Workbench(root=tmp_path), terminal_size=size, run_before=show)


@pytest.mark.parametrize("number", range(1, len(FACES) + 1), ids=[face.mode for face in FACES])
def test_screen_before_anything_has_happened(
    snap_compare: Look, tmp_path: Path, number: int
) -> None:
    async def show(pilot: Pilot[Any]) -> None:
        await pilot.press(str(number))
        await pilot.pause(0.3)

    assert snap_compare(Workbench(root=tmp_path), terminal_size=(80, 24), run_before=show)


@pytest.mark.parametrize("size", SIZES, ids=["80x24", "160x48"])
def test_question_with_a_fault_on_the_banner(
    snap_compare: Look, tmp_path: Path, size: tuple[int, int]
) -> None:
    async def show(pilot: Pilot[Any]) -> None:
        bench = await full(pilot, tmp_path)
        await pilot.press("2")
        bench.desk.picture.say_trouble("tracker: the beam is broken", "Bring the SMR back")
        bench.desk.picture.tell(stream.QUESTION)
        await pilot.pause(0.6)

    assert snap_compare(Workbench(root=tmp_path), terminal_size=size, run_before=show)


@pytest.mark.parametrize("size", SIZES, ids=["80x24", "160x48"])
def test_decision_of_the_autopilot(
    snap_compare: Look, tmp_path: Path, size: tuple[int, int]
) -> None:
    async def show(pilot: Pilot[Any]) -> None:
        bench = await full(pilot, tmp_path)
        await pilot.press("8")
        bench.desk.picture.tell(stream.DECISION)
        await pilot.pause(0.6)

    assert snap_compare(Workbench(root=tmp_path), terminal_size=size, run_before=show)


@pytest.mark.parametrize(
    "key", ["f1", "n", "m", "a"], ids=["help", "new-run", "mock", "decide-by-itself"]
)
def test_dialog(snap_compare: Look, tmp_path: Path, key: str) -> None:
    async def show(pilot: Pilot[Any]) -> None:
        if key == "n":
            from app.files.site import load_site
            from app.tui.planning import NewRun

            (tmp_path / "site.toml").write_text(stream.SITE, encoding="utf-8")
            pilot.app.push_screen(NewRun(load_site(tmp_path / "site.toml")))
        elif key == "a":
            from app.tui.planning import NewFlight

            pilot.app.push_screen(NewFlight())
        else:
            await pilot.press(key)
        await pilot.pause(0.3)
        for line in pilot.app.screen.query("Input"):
            line.cursor_blink = False  # type: ignore[attr-defined]

    assert snap_compare(Workbench(root=tmp_path), terminal_size=(80, 24), run_before=show)
