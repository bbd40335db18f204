"""What comes next is said on every screen; before and after stand pose by pose."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tui_stream as stream

from app.tui.next_step import NextLine, job_steps, next_of
from app.tui.program import FACES, Workbench
from app.tui.verify import aligned


@pytest.mark.long
async def test_every_screen_says_what_comes_next(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(80, 24)) as pilot:
        for number in range(1, len(FACES) + 1):
            await pilot.press(str(number))
            await pilot.pause()
            line = str(bench.screen.query_one(NextLine).render())
            assert line.startswith("next 1 o or m")
            assert len(line) <= 78
            assert line.endswith("record")


async def test_the_next_step_moves_on_with_the_job(tmp_path: Path) -> None:
    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(80, 24)):
        desk = bench.desk

        def coming() -> str:
            step = next_of(
                [replace(s, done=s.done or s.word == "connect") for s in job_steps(desk)]
            )
            return step.word if step is not None else ""

        assert coming() == "found"
        desk.course.done.add("found")
        assert coming() == "measure"
        desk.study.choose(("sessions/run",))
        assert coming() == "fit"
        desk.study.answer = stream.fitted()
        assert coming() == "discover"
        desk.course.done.add("applied")
        assert coming() == "left"
        desk.course.done |= {"left", "record"}
        assert coming() == ""
        assert next_of(job_steps(desk)) is None


GAUGE = """format = "pkm-site/1"
machine = "delta"
[controller]
kind = "operator"
[gauge]
kind = "operator"
reads = "distance"
sigma = 0.02
[nests.platform]
tool = [0.0, 0.0, 0.0]
"""


async def test_with_a_gauge_nothing_comes_next_that_only_a_tracker_can(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(GAUGE, encoding="utf-8")
    bench = Workbench(root=tmp_path)
    async with bench.run_test(size=(80, 24)):
        await bench.desk.open_site(tmp_path / "site.toml")
        words = [step.word for step in job_steps(bench.desk)]
        assert words == ["connect", "measure", "fit", "discover"]


def test_a_quick_verification_stands_at_the_places_of_the_whole_one() -> None:
    whole = stream.verified(600.0, 1)
    some = slice(3, None, 8)
    found = whole.found
    part = replace(whole, errors=whole.errors[:, some], found=replace(
        found, labels=found.labels[some], position_mm=found.position_mm[:, some],
        rotation_rad=found.rotation_rad[:, some],
    ))  # fmt: skip
    series = aligned(part, whole, 0)
    assert np.array_equal(series["after"][0], np.arange(1.0, 217.0))
    assert np.array_equal(series["before"][0], np.arange(1.0, 217.0)[some])
    assert np.array_equal(series["before"][1], whole.errors[0][some])
