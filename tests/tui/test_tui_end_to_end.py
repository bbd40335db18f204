"""The whole job by keys, through real wires: connect, measure, fit, apply, verify, undo."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

from app.session.hands import MockControl
from app.tui.dialogs import Ask
from app.tui.face import Face
from app.tui.planning import NewRun
from app.tui.program import Workbench

SCALE = 400


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PKMCAL_STATE", str(tmp_path / "state"))


async def until(pilot: Pilot[Any], true: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait for a condition; what is on the banner and in the log says why it did not come."""
    bench = pilot.app
    assert isinstance(bench, Workbench)
    try:
        async with asyncio.timeout(seconds):
            while not true():  # noqa: ASYNC110 - a condition of many parts, none an event
                await asyncio.sleep(0.05)
    except TimeoutError:
        lines = [line.text for line in bench.desk.picture.log][-12:]
        pytest.fail("\n".join([f"not yet; {bench.desk.picture.run}; the log ends:", *lines]))
    await pilot.pause()


async def start_mock(pilot: Pilot[Any], bench: Workbench, arguments: str) -> None:
    """By keys: m, the arguments, enter; it connects by itself."""
    await pilot.press("m")
    await pilot.pause(0.1)
    bench.screen.query_one(Input).value = arguments
    await pilot.press("enter")
    await until(pilot, lambda: bench.desk.connected)


async def new_run(pilot: Pilot[Any], bench: Workbench, poses: str) -> None:
    """By keys: the Measure screen, n, the number of poses, enter."""
    await pilot.press("2", "n")
    await until(pilot, lambda: isinstance(bench.screen, NewRun))
    bench.screen.query_one("#poses", Input).value = poses
    await pilot.press("enter")


def asks_for(bench: Workbench, nest: str) -> bool:
    """Whether the dialog that asks for an SMR in a nest is open."""
    prompt = bench.desk.picture.prompt
    return prompt is not None and f"nest {nest}" in prompt.text and isinstance(bench.screen, Ask)


@pytest.mark.long
async def test_connect_measure_fit_apply_verify_undo(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path / "sessions")
    desk = bench.desk
    async with bench.run_test(size=(80, 24)) as pilot:
        await start_mock(pilot, bench, f"hexapod --seed 5 --scale {SCALE} --smrs 3")
        await new_run(pilot, bench, "14")
        await until(pilot, lambda: desk.picture.run == "finished")
        assert desk.site is not None
        on_platform = [p for p in desk.picture.points if p.nest in desk.site.platform_nests]
        assert len(on_platform) == 14 * 3
        assert all(step.state == "done" for step in desk.picture.steps)

        await pilot.press("3", "f")
        await until(pilot, lambda: desk.study.answer is not None)
        assert desk.study.answer is not None
        report = desk.study.answer.report
        assert report["rms_um"] < 0.1 * desk.study.answer.before_um

        await pilot.press("5", "c")
        await until(pilot, lambda: desk.corrections.comparison is not None)
        await pilot.press("a")
        await pilot.pause(0.1)
        await pilot.press("a")
        await until(pilot, lambda: isinstance(bench.screen, Ask))
        await pilot.press("k")
        await until(pilot, lambda: desk.picture.run == "finished")
        assert len(desk.corrections.snapshots) == 2
        assert desk.picture.stages[-1].stage == "done"

        await pilot.press("6", "v", "q")
        await until(pilot, lambda: desk.course.after is not None)
        assert desk.course.after is not None
        assert desk.course.after.found.truth is not None
        assert desk.course.after.found.truth.position_peak_um < 15.0

        await pilot.press("5", "u")
        await pilot.pause(0.3)
        await pilot.press("end", "enter")
        await until(pilot, lambda: len(desk.corrections.snapshots) == 3)
        assert desk.station is not None
        held = await desk.station.controller.read_parameters()
        assert held == desk.corrections.snapshots[0].values
        await pilot.press("ctrl+q")
        await pilot.pause(0.5)
    assert desk.mock is None


@pytest.mark.long
async def test_questions_are_answered_by_keys_and_a_stop_is_gone_on_with(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path / "sessions")
    desk = bench.desk
    async with bench.run_test(size=(80, 24)) as pilot:
        await start_mock(pilot, bench, f"hexapod --seed 5 --scale {SCALE}")
        # The same station, but a person carries: the test does, behind the program's back.
        assert desk.site is not None
        control = MockControl(desk.site.hands.host, desk.site.hands.port)
        text = desk.site.to_toml()
        head, _, rest = text.partition("[hands]")
        tail = rest.partition("\n[")[2]
        site = tmp_path / "site.toml"
        site.write_text(f"{head}[hands]\nkind = 'operator'\nsmrs = 1\n\n[{tail}")
        await desk.open_site(site)
        await pilot.press("1", "c")
        await until(pilot, lambda: desk.connected)

        await new_run(pilot, bench, "3")
        await until(pilot, lambda: asks_for(bench, "3"))
        await control.call("carry", smr=1, nest="3")
        await pilot.press("d")
        await until(pilot, lambda: len(desk.picture.points) >= 2)
        await pilot.press("ctrl+x")
        await until(pilot, lambda: desk.picture.run == "stopped")
        assert desk.picture.trouble is not None
        assert "g on the Measure screen" in desk.picture.trouble.remedy
        read = len(desk.picture.points)

        await until(pilot, lambda: not desk.busy and isinstance(bench.screen, Face))
        await pilot.press("g")
        await pilot.pause(0.2)
        await pilot.press("enter")
        for nest in ("4", "5"):
            await until(pilot, lambda nest=nest: asks_for(bench, nest))
            await control.call("carry", smr=1, nest=nest)
            await pilot.press("d")
        await until(pilot, lambda: desk.picture.run == "finished")
        assert len(desk.picture.points) >= read
        assert {point.nest for point in desk.picture.points} >= {"3", "4", "5"}
        await desk.close()
