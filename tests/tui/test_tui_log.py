"""The log: the newest line is in sight when the screen is opened, and stays so."""

from pathlib import Path

from app.tui.log import LogLines
from app.tui.program import Workbench


async def test_the_newest_line_is_in_sight(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(80, 24)) as pilot:
        for number in range(60):
            bench.desk.picture.write(f"line {number}")
        await pilot.press("7")
        await pilot.pause(0.3)
        lines = bench.screen.query_one(LogLines)
        assert lines.scroll_offset.y == lines.max_scroll_y > 0
        bench.desk.picture.write("one more")
        await pilot.pause(0.4)
        assert lines.scroll_offset.y == lines.max_scroll_y
        await pilot.press("home")
        bench.desk.picture.write("another")
        await pilot.pause(0.4)
        assert lines.scroll_offset.y == 0
