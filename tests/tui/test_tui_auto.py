"""The autopilot on its screen: asked before it does anything, stopped, gone on with, refused."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

import pkmcal
from app.auto.journal import Decisions
from app.tui.automatic import begun_under
from app.tui.dialogs import Ask
from app.tui.planning import NewFlight
from app.tui.program import Workbench


async def until(true: Callable[[], bool]) -> None:
    async with asyncio.timeout(30.0):
        while not true():  # noqa: ASYNC110 - a condition of several parts, none an event
            await asyncio.sleep(0.05)


async def asked(bench: Workbench, pilot: Pilot[None]) -> None:
    await until(lambda: isinstance(bench.screen, Ask))
    await pilot.pause(0.1)


@pytest.mark.long
@pytest.mark.timeout(120)
async def test_a_decision_is_asked_stopped_gone_on_with_and_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PKMCAL_STATE", str(tmp_path / "state"))
    with pkmcal.mock_station(seed=4, scale=1500.0, folder=tmp_path / "mock") as site:
        bench = Workbench(site, root=tmp_path / "sessions")
        desk = bench.desk
        async with bench.run_test(size=(80, 24)) as pilot:
            await until(lambda: desk.site is not None)
            await desk.connect()
            await pilot.press("8", "n")
            await until(lambda: isinstance(bench.screen, NewFlight))
            for target, first in (("-3", "15"), ("12", "100")):
                bench.screen.query_one("#target", Input).value = target
                bench.screen.query_one("#first", Input).value = first
                await pilot.press("enter")
                await pilot.pause(0.1)
                assert isinstance(bench.screen, NewFlight)  # what makes no sense is not begun
            bench.screen.query_one("#first", Input).value = "9"
            await pilot.press("enter")
            await asked(bench, pilot)
            prompt = desk.picture.prompt
            assert prompt is not None
            assert prompt.text == "measure 9 poses: nothing was measured yet"
            assert (prompt.choices, prompt.default) == (("go on", "skip", "stop"), None)
            await pilot.press("escape")
            await pilot.press("ctrl+x")
            await until(lambda: not desk.busy)
            assert desk.picture.run == "stopped"
            (folder,) = begun_under(desk.root)
            assert Decisions(folder).open is not None

            await pilot.press("g")
            await pilot.pause(0.2)
            await pilot.press("enter")
            await asked(bench, pilot)
            await pilot.press("s")
            await until(lambda: not desk.busy)
            await pilot.pause(0.3)
            assert desk.picture.run == "finished"
            kinds = [line["kind"] for line in Decisions(folder).of("decided")]
            assert kinds == ["measure", "stop"]
            assert begun_under(desk.root) == []
            await desk.close()
