"""History and Watch: what the folder holds, read-only, and the way back to where one was."""

from pathlib import Path

import pytest
import tui_stream as stream
from textual.widgets import DataTable, Static

from app.session.journal import Journal
from app.tui.dialogs import Pick
from app.tui.history import HistoryFace, told, words_of
from app.tui.history_view import series_of
from app.tui.program import Workbench
from app.tui.watch import WatchFace
from app.tui.watching import SILENT_S, Watching


async def test_what_changed_and_what_drifts_stand_first_with_a_forecast(tmp_path: Path) -> None:
    stream.remember(tmp_path)
    bench = Workbench(root=tmp_path)
    await bench.desk.look_back()
    series = series_of(bench.desk.past.machine)
    assert [one.name for one in series][:2] == ["leg1.L0", "leg3.L0"]
    assert told(series).startswith("5 calibrations; ")
    drifts = words_of(series[1]).plain
    assert "µm a month; out of tolerance" in drifts
    assert "no more than chance" in words_of(series[-1]).plain


@pytest.mark.long
async def test_history_is_a_key_away_and_leads_back(tmp_path: Path) -> None:
    stream.remember(tmp_path)
    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("6", "h")
        await pilot.pause(0.6)
        assert isinstance(bench.screen, HistoryFace)
        table = bench.screen.query_one(DataTable)
        assert table.row_count == 12
        await pilot.press("down")
        await pilot.pause(0.2)
        said = str(bench.screen.query_one("#history-words", Static).render())
        assert said.startswith("leg3.L0")
        await pilot.press("escape")
        await pilot.pause(0.2)
        assert bench.current_mode == "verify"


async def test_a_watched_session_is_followed_and_never_written_to(tmp_path: Path) -> None:
    folder = stream.begun_elsewhere(tmp_path)
    watched = Watching(folder)
    assert await watched.look()
    assert not await watched.look()
    assert (watched.facts.done, watched.facts.state) == (5, "begun")
    assert watched.doing
    other = Journal(folder / "journal.sqlite")  # the terminal that runs it
    other.note("alarm", "the beam is broken", 7.0, "2026-11-29T06:00:07.000+00:00")
    other.close()
    assert await watched.look()
    assert "the beam is broken" in watched.picture.log[-1].text
    assert watched.quiet_s == 0.0
    watched._quiet_since -= 2.0 * SILENT_S
    assert watched.quiet_s > SILENT_S


@pytest.mark.long
async def test_the_session_to_watch_is_chosen_once(tmp_path: Path) -> None:
    stream.begun_elsewhere(tmp_path)
    bench = Workbench(root=tmp_path / "elsewhere")
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("a")
        await pilot.pause(0.4)
        assert isinstance(bench.screen, Pick)
        await pilot.press("enter")
        await pilot.pause(1.0)
        assert isinstance(bench.screen, WatchFace)
        state = str(bench.screen.query_one("#watch-state", Static).render())
        assert "5 of" in state
        assert bench.desk.session is None  # nothing of it is this terminal's
        await pilot.press("escape")
        await pilot.pause(0.2)
        assert bench.current_mode == "devices"
