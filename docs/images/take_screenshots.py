"""Take the pictures of docs/terminal-ui.md: the program, driven by keys, on a mock machine.

python docs/images/take_screenshots.py              (all, about three minutes)
python docs/images/take_screenshots.py analysis     (those on runs from the disk: seconds)
python docs/images/take_screenshots.py auto         (the autopilot: a minute)
"""

import asyncio
import os
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from textual.pilot import Pilot
from textual.widgets import Input

from app.files.site import Site, site_of_mock
from app.tui import mock_process
from app.tui.dialogs import Ask
from app.tui.program import Workbench

HERE = Path(__file__).parent
MYSTERY = HERE.parent.parent / "tests" / "data" / "runs" / "mystery"
SIZE = (120, 38)
MOCK = "hexapod --seed 7 --scale 150 --smrs 3"


def patient(announcement: dict[str, Any]) -> Site:
    """The site of a mock whose drives bear a PC that is busy with other things."""
    announcement["site"]["controller"]["silence_s"] = 10.0
    return site_of_mock(announcement)


class Photographer:
    """Presses keys, waits, takes pictures."""

    def __init__(self, bench: Workbench, pilot: Pilot[Any]) -> None:
        self.bench = bench
        self.pilot = pilot

    async def until(self, true: Callable[[], bool]) -> None:
        """Wait for a condition, at most three minutes."""
        try:
            async with asyncio.timeout(180.0):
                while not true():  # noqa: ASYNC110 - a condition of many parts, none an event
                    await asyncio.sleep(0.05)
        except TimeoutError:
            log = [line.text for line in self.bench.desk.picture.log]
            raise SystemExit("\n".join(["not within three minutes:", *log[-12:]])) from None
        await self.pilot.pause(0.4)

    async def keys(self, *keys: str) -> None:
        """Press keys one by one, with time to see what they do."""
        for key in keys:
            await self.pilot.press(key)
            await self.pilot.pause(0.3)

    async def picture(self, name: str) -> None:
        """Write what is on the screen."""
        await self.pilot.pause(0.4)
        picture = self.bench.export_screenshot()
        # Nothing is fetched by who looks at it: the fonts are the viewer's own.
        picture = re.sub(r"@font-face\s*{[^}]*}", "", picture)
        (HERE / f"{name}.svg").write_text(picture, encoding="utf-8")


async def start_mock(photographer: Photographer) -> None:
    """A mock machine of our own, connected."""
    bench = photographer.bench
    await photographer.keys("1", "m")
    bench.screen.query_one(Input).value = MOCK
    await photographer.keys("enter")
    await photographer.until(lambda: bench.desk.connected)


async def connect_and_measure(photographer: Photographer) -> None:
    """Devices, a first verification, and a measurement with the plot half full."""
    desk = photographer.bench.desk
    await start_mock(photographer)
    await photographer.keys("6", "v", "q")
    await photographer.until(lambda: desk.course.after is not None)
    await photographer.keys("2", "n", "enter")
    await photographer.until(lambda: desk.picture.purpose == "measure")
    await photographer.until(lambda: len(desk.picture.points) > 55)
    await photographer.picture("measure")
    await photographer.keys("1")
    await photographer.picture("devices")
    await photographer.until(lambda: desk.picture.run == "finished")


async def correct(photographer: Photographer) -> None:
    """Fit, apply, verify."""
    bench, desk = photographer.bench, photographer.bench.desk
    await photographer.keys("3", "f")
    await photographer.until(lambda: desk.study.answer is not None)
    await photographer.picture("fit")
    await photographer.keys("5", "c")
    await photographer.until(lambda: desk.corrections.comparison is not None)
    await photographer.keys("a", "a")
    await photographer.until(lambda: isinstance(bench.screen, Ask))
    await photographer.picture("apply")
    await photographer.keys("k")
    await photographer.until(lambda: desk.picture.run == "finished")
    await photographer.keys("6", "v", "q")
    await photographer.until(lambda: desk.course.before is not None)
    await photographer.picture("verify")
    await look_back(photographer)
    await photographer.keys("7")
    await photographer.picture("log")


async def look_back(photographer: Photographer) -> None:
    """What the folder holds by now."""
    await photographer.keys("h")
    await photographer.picture("history")
    await photographer.keys("escape", "1", "a", "enter")
    await photographer.until(lambda: photographer.bench.desk.watched is not None)
    await photographer.pilot.pause(1.0)
    await photographer.picture("watch")
    await photographer.keys("escape")


async def discover(photographer: Photographer) -> None:
    """The mystery run: what is missing, and the staircase."""
    study = photographer.bench.desk.study
    study.choose((str(MYSTERY),))
    await photographer.keys("4", "d")
    await photographer.until(lambda: study.search is not None)
    await photographer.picture("discover-asked")
    await photographer.keys("g")
    await photographer.until(lambda: len(study.effects) > 1)
    await photographer.picture("discover")
    await photographer.keys("e")
    await photographer.picture("residuals")
    await photographer.keys("escape")


async def job(photographer: Photographer) -> None:
    """The pictures of the job, on the mock."""
    await connect_and_measure(photographer)
    await correct(photographer)


async def automatic(photographer: Photographer) -> None:
    """The autopilot, at the question after its first poses."""
    bench, desk = photographer.bench, photographer.bench.desk
    if not desk.connected:
        await start_mock(photographer)
    await photographer.keys("8", "n")
    bench.screen.query_one("#first", Input).value = "12"
    await photographer.keys("enter")
    await photographer.until(lambda: isinstance(bench.screen, Ask))
    await photographer.keys("g")
    await photographer.until(lambda: not isinstance(bench.screen, Ask))
    await photographer.until(lambda: isinstance(bench.screen, Ask))
    await photographer.picture("auto")
    await photographer.keys("escape", "ctrl+x")
    await photographer.until(lambda: not desk.busy)


PARTS = {"job": job, "analysis": discover, "auto": automatic}


async def main(parts: list[str]) -> None:
    """Take the pictures of some parts, in a folder of its own."""
    mock_process.site_of_mock = patient  # type: ignore[assignment]
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PKMCAL_STATE"] = str(Path(folder) / "state")
        bench = Workbench(root=Path(folder) / "sessions")
        async with bench.run_test(size=SIZE) as pilot:
            photographer = Photographer(bench, pilot)
            for part in parts:
                await PARTS[part](photographer)
            await bench.desk.close()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1:] or list(PARTS)))
