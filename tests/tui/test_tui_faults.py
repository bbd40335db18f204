"""Bad days, through the wires: the screen says what happened, what to do, and stays alive."""

import asyncio
from pathlib import Path

import pytest
from test_tui_end_to_end import SCALE, new_run, start_mock, until

from app.errors import StoppedByOperator
from app.session.hands import MockControl
from app.tui.correction import end_words
from app.tui.picture import Picture
from app.tui.program import Workbench
from app.tui.widgets.frame import Banner
from drivers.errors import DriveFault


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PKMCAL_STATE", str(tmp_path / "state"))


# python-can's receiving thread ends with an exception of its own when its link goes.
@pytest.mark.long
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
async def test_station_that_dies_in_a_run(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path / "sessions")
    desk = bench.desk
    async with bench.run_test(size=(80, 24)) as pilot:
        await start_mock(pilot, bench, f"hexapod --seed 5 --scale {SCALE} --smrs 3")
        await new_run(pilot, bench, "29")
        await until(pilot, lambda: len(desk.picture.points) > 2)
        assert desk.mock is not None
        desk.mock.kill()
        await until(pilot, lambda: desk.picture.run == "fault")
        await pilot.pause(0.5)
        trouble = desk.picture.trouble
        assert trouble is not None
        assert trouble.what
        assert trouble.remedy
        assert bench.screen.query_one(Banner).display
        await pilot.press("ctrl+x", "7")
        await pilot.pause(0.3)
        assert bench.current_mode == "log"
        await desk.close()


@pytest.mark.long
async def test_beam_that_is_broken_is_waited_for(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path / "sessions")
    desk = bench.desk
    async with bench.run_test(size=(80, 24)) as pilot:
        await start_mock(pilot, bench, f"hexapod --seed 5 --scale {SCALE} --smrs 3")
        assert desk.site is not None
        control = MockControl(desk.site.hands.host, desk.site.hands.port)
        await new_run(pilot, bench, "29")
        await until(pilot, lambda: len(desk.picture.points) > 2)
        read = len(desk.picture.points)
        await control.call("break-beam", for_s=1.5 * SCALE)
        await until(pilot, lambda: any("beam" in line.text for line in desk.picture.log))
        async with asyncio.timeout(60.0):
            while len(desk.picture.points) < read + 4:  # noqa: ASYNC110 - a plain value
                await asyncio.sleep(0.05)
        await pilot.press("ctrl+x")
        await until(pilot, lambda: desk.picture.run == "stopped")
        await desk.close()


LINK = DriveFault("it no longer hears the PC", device="drive q1", remedy="Look at the cable")
DONE = ["snapshot", "verify", "write", "read-back", "verify", "restore"]


@pytest.mark.parametrize(
    ("stages", "error", "says", "level"),
    [
        ([], LINK, "Nothing was written: drive q1: it no longer hears the PC", "warn"),
        (DONE[:2], StoppedByOperator("x"), "Nothing was written: stopped by the operator", "warn"),
        ([*DONE, "restored"], LINK, "The earlier parameters are back", "warn"),
        ([*DONE, "restore-failed"], LINK, "What the controller holds is not known", "bad"),
    ],
)
async def test_a_fault_of_a_write_back_says_what_it_means_for_what_was_written(
    tmp_path: Path, stages: list[str], error: Exception, says: str, level: str
) -> None:
    bench = Workbench(root=tmp_path)
    picture = bench.desk.picture
    picture.say_trouble(*end_words(stages, error))
    if not isinstance(error, StoppedByOperator):
        bench.put_up(error)  # as it is raised on, it is said no less well
    assert picture.trouble is not None
    assert says in picture.trouble.what
    assert picture.trouble.level == level
    assert "resume" not in picture.trouble.remedy


def test_what_a_key_could_not_do_covers_a_fault_until_the_next_key() -> None:
    picture = Picture()
    picture.say_trouble("drive q1: it no longer hears the PC", "Look at the cable")
    fault = picture.trouble
    for _ in range(2):
        picture.refuse("there is no run yet", "Measure one")
        assert picture.trouble is not None
        assert picture.trouble.what == "there is no run yet"
    picture.pass_on()
    assert picture.trouble is fault
    picture.pass_on()
    assert picture.trouble is fault
