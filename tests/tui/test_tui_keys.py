"""Keys: the stop key everywhere, prompts, number keys, the palette, errors on the banner."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest
import tui_stream as stream
from textual.command import CommandPalette
from textual.widgets import Input

from app.tui.browsing import Browse
from app.tui.dialogs import Ask, Choose, Enter, Help, Pick, choice_keys
from app.tui.face import Face
from app.tui.program import FACES, SIDES, Workbench, bindings_of
from app.tui.widgets.frame import Banner, TopLine
from calib.errors import BadInput


@pytest.fixture
def bench(tmp_path: Path) -> Workbench:
    return Workbench(root=tmp_path / "sessions")


def stops(bench: Workbench) -> int:
    return sum(line.text.startswith("STOP") for line in bench.desk.picture.log)


@pytest.mark.long
@pytest.mark.parametrize(
    "opens", ["f1", "m", "ctrl+p", None], ids=["help", "input", "palette", "-"]
)
async def test_stop_key_works_everywhere(bench: Workbench, opens: str | None) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        if opens:
            await pilot.press(opens)
            await pilot.pause(0.2)
            assert not isinstance(bench.screen, Face)
        await pilot.press("ctrl+x")
        await pilot.pause(0.2)
        assert stops(bench) == 1


async def test_stop_key_works_in_a_question(bench: Workbench, tmp_path: Path) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await stream.put_up(bench, tmp_path)
        bench.desk.picture.tell(stream.QUESTION)
        await pilot.pause(0.4)
        assert isinstance(bench.screen, Ask)
        await pilot.press("ctrl+x")
        await pilot.pause(0.2)
        assert stops(bench) == 1


@pytest.mark.long
@pytest.mark.parametrize("size", [(80, 24), (160, 48)])
async def test_stop_key_is_in_sight_on_every_screen(
    bench: Workbench, size: tuple[int, int]
) -> None:
    async with bench.run_test(size=size) as pilot:
        for number in range(1, len(FACES) + 1):
            await pilot.press(str(number))
            await pilot.pause()
            stop = bench.screen.query_one(TopLine).query_one("#top-stop")
            assert stop.region.right == size[0]
            assert stop.region.width >= len("STOP ctrl+x")


@pytest.mark.long
async def test_stop_at_the_top_works_by_mouse_whatever_lies_over_it(bench: Workbench) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        for done, opens in enumerate((None, "m", "ctrl+p"), start=1):
            if opens is not None:
                await pilot.press(opens)
                await pilot.pause(0.3)
                assert not isinstance(bench.screen, Face)
            await pilot.click(offset=(74, 0))
            await pilot.pause(0.3)
            assert stops(bench) == done
            if opens == "m":
                await pilot.press("escape")
                await pilot.pause(0.1)


async def test_number_keys_are_text_inside_a_line(bench: Workbench) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("m")
        await pilot.pause(0.1)
        line = bench.screen.query_one(Input)
        line.value = ""
        await pilot.press("2", "a")
        assert line.value == "2a"
        assert isinstance(bench.screen, Enter)


async def test_question_can_be_looked_past_and_comes_back(bench: Workbench, tmp_path: Path) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await stream.put_up(bench, tmp_path)
        bench.desk.picture.tell(stream.QUESTION)
        await pilot.pause(0.3)
        await pilot.press("escape")
        await pilot.pause(0.3)
        assert isinstance(bench.screen, Face)
        assert bench.desk.picture.prompt is not None
        await pilot.press("r")
        await pilot.pause(0.3)
        assert isinstance(bench.screen, Ask)


async def test_question_closes_when_somebody_else_answers(bench: Workbench, tmp_path: Path) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await stream.put_up(bench, tmp_path)
        bench.desk.picture.tell(stream.QUESTION)
        await pilot.pause(0.3)
        bench.desk.picture.tell(stream.ev.PromptAnswered("prompt-1", "done"))
        await pilot.pause(0.3)
        assert isinstance(bench.screen, Face)


@pytest.mark.long
async def test_a_question_opens_though_an_earlier_one_had_its_name(
    bench: Workbench, tmp_path: Path
) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await stream.put_up(bench, tmp_path)
        bench.desk.picture.tell(stream.QUESTION)
        await pilot.pause(0.3)
        await pilot.press("d")
        bench.desk.picture.tell(stream.ev.PromptAnswered("prompt-1", "done"))
        await pilot.pause(0.3)
        assert isinstance(bench.screen, Face)
        bench.desk.picture.tell(replace(stream.QUESTION))
        await pilot.pause(0.3)
        assert isinstance(bench.screen, Ask)


@pytest.mark.long
@pytest.mark.parametrize(("proposed", "focused"), [(None, None), ("stop", "stop")])
async def test_enter_gives_the_proposed_answer_and_no_other(
    bench: Workbench, tmp_path: Path, proposed: str | None, focused: str | None
) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await stream.put_up(bench, tmp_path)
        bench.desk.picture.tell(replace(stream.QUESTION, default=proposed))
        await pilot.pause(0.3)
        while not isinstance(bench.screen, Ask) or _focused(bench) != focused:  # or the test ends
            await pilot.pause(0.1)
        await pilot.press("enter")
        await pilot.pause(0.3)
        while isinstance(bench.screen, Ask) != (proposed is None):
            await pilot.pause(0.1)


def _focused(bench: Workbench) -> str | None:
    button = bench.screen.focused
    return button.name if button is not None else None


def test_each_choice_has_a_key_of_its_own() -> None:
    assert choice_keys(("done", "drop", "do it")) == {"d": "done", "r": "drop", "o": "do it"}


async def test_errors_say_what_to_do_on_the_banner(bench: Workbench) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("c")
        await pilot.pause(0.5)
        banner = bench.screen.query_one(Banner)
        assert banner.display
        text = str(banner.render())
        assert "no site is open" in text
        assert "start a mock" in text
        await pilot.press("b")
        await pilot.pause(0.4)
        assert not banner.display


async def test_unknown_site_file_is_named(bench: Workbench, tmp_path: Path) -> None:
    wrong = tmp_path / "site.toml"
    wrong.write_text(stream.SITE.replace("emscon", "emscn"), encoding="utf-8")
    async with bench.run_test(size=(80, 24)) as pilot:
        bench.act(lambda: bench.desk.open_site(wrong))
        await pilot.pause(0.3)
        assert bench.desk.picture.trouble is not None
        assert "site.toml" in bench.desk.picture.trouble.what


async def test_every_action_is_in_the_palette_with_its_key(bench: Workbench) -> None:
    async with bench.run_test(size=(80, 24)):
        titles = {command.title for command in bench.get_system_commands(bench.screen)}
        for face in (*FACES, *SIDES):
            for binding in bindings_of(face):
                assert f"{face.label}: {binding.description}" in titles
        assert {"STOP", "Quit", "Help"} <= titles


def test_every_key_is_explained_and_none_is_used_twice_on_a_screen() -> None:
    everywhere = [binding.key for binding in bindings_of(Workbench)]
    for face in (*FACES, *SIDES):
        keys = [binding.key for binding in bindings_of(face)] + everywhere
        assert len(keys) == len(set(keys)), (face, keys)
        assert all(binding.tooltip and binding.description for binding in bindings_of(face))
        assert len(face.about) > 100


@pytest.mark.long
async def test_palette_runs_an_action_of_another_screen(bench: Workbench) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("ctrl+p")
        await pilot.pause(0.3)
        assert isinstance(bench.screen, CommandPalette)
        await pilot.press(*"fit: run")
        await pilot.pause(0.8)
        await pilot.press("enter")
        await pilot.pause(0.2)
        await pilot.press("enter")
        await pilot.pause(0.5)
        assert bench.current_mode == "fit"
        assert isinstance(bench.screen, Pick | Browse)


async def test_help_lists_the_keys_of_the_screen(bench: Workbench) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("2", "f1")
        await pilot.pause(0.2)
        assert isinstance(bench.screen, Help)
        shown = " ".join(str(each.render()) for each in bench.screen.query("Static"))
        assert "Pause" in shown
        assert "STOP" in shown


@pytest.mark.long
async def test_leaving_asks_while_a_job_runs(bench: Workbench) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        waiting = asyncio.Event()
        job = asyncio.create_task(bench.desk.as_job(waiting.wait()))
        await pilot.pause(0.1)
        await pilot.press("ctrl+q")
        await pilot.pause(0.2)
        assert isinstance(bench.screen, Choose)
        await pilot.press("g")
        await pilot.pause(0.2)
        assert isinstance(bench.screen, Face)
        waiting.set()
        await job
        await pilot.press("ctrl+q")
        await pilot.pause(0.2)
    assert bench.return_code == 0


@pytest.mark.long
async def test_discover_adds_refuses_and_removes(bench: Workbench) -> None:
    run = Path(__file__).parent.parent / "data" / "runs" / "backlash-leg-3"
    study = bench.desk.study
    study.choose((str(run),))
    async with bench.run_test(size=(160, 48)) as pilot:
        await study.diagnose()
        await pilot.press("4")
        await pilot.pause(0.4)
        assert study.search is not None
        assert study.search.present.diagnosis["candidates"][0]["effect"] == "backlash"
        await pilot.press("a")
        async with asyncio.timeout(60.0):
            while study.effects != ("backlash",):  # noqa: ASYNC110 - a plain value, not an event
                await asyncio.sleep(0.05)
        before, after = study.search.stairs
        assert after.rms_um < 0.9 * before.rms_um
        assert study.answer is not None
        assert study.answer.effects == ("backlash",)
        with pytest.raises(BadInput, match="not accepted"):
            await study.change("add", "tracker-drift")
        assert study.effects == ("backlash",)
        await pilot.press("x")
        async with asyncio.timeout(60.0):
            while study.effects:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        assert study.search.stairs[-1].rms_um == before.rms_um


@pytest.mark.timeout(30)
async def test_keys_behind_an_answer_close_nothing_else(bench: Workbench, tmp_path: Path) -> None:
    async with bench.run_test(size=(80, 24)) as pilot:
        await stream.put_up(bench, tmp_path)
        bench.desk.picture.tell(stream.QUESTION)
        await pilot.pause(0.3)
        dialog = bench.screen
        assert isinstance(dialog, Ask)
        dialog.dismiss("done")
        dialog.dismiss("stop")
        await pilot.pause(0.2)
        assert isinstance(bench.screen, Face)
