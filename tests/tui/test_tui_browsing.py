"""Looking for a run in the folders: only what can be taken is shown, and it is taken."""

from pathlib import Path

import pytest
from textual.widgets import DirectoryTree

from app.tui.browsing import Browse
from app.tui.choosing import IS_MODEL, IS_POSES, IS_SITE, here
from app.tui.dialogs import Pick
from app.tui.program import Workbench


@pytest.mark.long
async def test_a_run_is_found_in_the_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "lab" / "monday"
    run.mkdir(parents=True)
    for name in ("run.toml", "points.csv", ".hidden"):
        (run / name).write_text("")
    monkeypatch.chdir(tmp_path)
    bench = Workbench(root=tmp_path / "sessions")
    asked: list[tuple[str, ...]] = []

    async def identify() -> None:
        asked.append(bench.desk.study.runs)

    bench.desk.study.identify = identify  # type: ignore[method-assign]
    async with bench.run_test(size=(80, 24)) as pilot:
        await pilot.press("3", "o")
        await pilot.pause(0.2)
        assert isinstance(bench.screen, Pick)
        await pilot.press("enter")
        await pilot.pause(0.4)
        assert isinstance(bench.screen, Browse)
        for _ in range(3):  # lab, monday, run.toml: the points are not shown
            await pilot.press("down", "enter")
            await pilot.pause(0.4)
        assert asked == [(str(run.resolve()),)]


@pytest.mark.long
async def test_the_folder_above_is_a_key_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    bench = Workbench(root=here)
    async with bench.run_test(size=(80, 24)) as pilot:
        bench.push_screen(Browse("Run", "Which?", Path(), lambda path: True))
        await pilot.pause(0.3)
        await pilot.press("backspace")
        await pilot.pause(0.2)
        tree = bench.screen.query_one(DirectoryTree)
        assert Path(tree.path).name == tmp_path.name
        assert "STOP ctrl+x" in str(bench.screen.query_one(".dialog-stop").render())


def test_only_what_says_so_is_taken(tmp_path: Path) -> None:
    known = {"site": IS_SITE, "model": IS_MODEL, "poses": IS_POSES}
    for form in known:
        (tmp_path / f"{form}.toml").write_text(f'format = "pkm-{form}/1"\n')
    (tmp_path / "folder.toml").mkdir()
    for form, wanted in known.items():
        assert [path for path, _ in here(tmp_path, wanted)] == [str(tmp_path / f"{form}.toml")]
        assert not wanted(tmp_path / "none.toml")
