"""The theme is kept and what is drawn follows it; nothing is overwritten unasked."""

from pathlib import Path

import pytest
import tui_stream as stream
from textual.widgets import Input

from app.tui.dialogs import Choose, Enter
from app.tui.preferences import keep_theme, kept_theme
from app.tui.program import Workbench
from app.tui.theme import (
    CONTRAST,
    FIXED,
    GROUNDS,
    INKED,
    LEVELS,
    SERIES,
    STYLES,
    contrast,
    tinted,
)
from app.tui.widgets.plots import MissPlot


@pytest.mark.long
async def test_a_theme_is_kept_and_plots_follow_it(tmp_path: Path, own_state: Path) -> None:
    first = Workbench(root=tmp_path)
    async with first.run_test(size=(80, 24)) as pilot:
        await stream.put_up(first, tmp_path)
        await pilot.press("2")
        await pilot.pause(0.3)
        plot = first.screen.query_one(MissPlot)
        before = plot.tint("primary"), plot._datasets[0].marker_style
        first.theme = "textual-light"
        await pilot.pause(0.4)
        assert plot.tint("primary") != before[0]
        assert plot._datasets[0].marker_style == plot.tint("primary") != before[1]
    again = Workbench(root=tmp_path)
    async with again.run_test(size=(80, 24)):
        assert again.theme == "textual-light"
    (own_state / "screens.json").write_text("{ torn")
    assert kept_theme() == ""
    keep_theme("no-such-theme")
    last = Workbench(root=tmp_path)
    async with last.run_test(size=(80, 24)):
        assert last.theme == "bench"


async def test_every_role_can_be_read_in_every_theme(tmp_path: Path) -> None:
    from rich.style import Style
    from textual.color import Color

    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(80, 24)) as pilot:
        styles = [*STYLES.values(), *(style for _, style in (*LEVELS.values(), *SERIES))]
        for name in bench.available_themes:
            bench.theme = name
            for style in styles:
                assert Style.parse(tinted(bench, style)).color is not None
            variables = bench.theme_variables
            grounds = [Color.parse(variables[ground]) for ground in GROUNDS]
            for role in (*INKED, *FIXED):
                ink = Color.parse(variables[f"ink-{role}"])
                for ground in grounds:
                    if ink.ansi is None and ground.ansi is None:
                        assert contrast(ink, ground) >= CONTRAST, (name, role)
        await pilot.pause()


@pytest.mark.long
async def test_what_is_there_is_overwritten_only_when_asked(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    there = tmp_path / "model.toml"
    there.write_text("mine")
    written: list[Path] = []

    async def save(path: Path) -> None:
        written.append(path)

    bench.desk.study.save = save  # type: ignore[method-assign]
    async with bench.run_test(size=(80, 24)) as pilot:

        async def name(path: Path) -> None:
            assert isinstance(bench.screen, Enter)
            bench.screen.query_one(Input).value = str(path)
            await pilot.press("enter")
            await pilot.pause(0.3)

        await pilot.press("3", "s")
        await pilot.pause(0.2)
        await name(there)
        assert isinstance(bench.screen, Choose)
        await pilot.press("enter")  # under Enter: another name
        await pilot.pause(0.2)
        assert written == []
        await name(tmp_path / "new.toml")
        assert written == [tmp_path / "new.toml"]
        await pilot.press("s")
        await pilot.pause(0.2)
        await name(there)
        await pilot.press("o")
        await pilot.pause(0.2)
        assert written[-1] == there
