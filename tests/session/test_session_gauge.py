"""A gauge drives a session: places on a plate, a bar between nests, marks; and what goes wrong."""

import asyncio
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from session_gauges import Hear, begun, once_read, run
from session_mock import Heard, Mock, start_mock

from app.errors import StoppedByOperator
from app.files.runs import read_run
from app.files.site import Site, parse_site
from app.session import events as ev
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from calib.errors import BadInput
from drivers.errors import DeviceError
from mocks.gauge import BAR_WRONG_MM

OPTIONS = PlanOptions(warm_up=False)
PLACES = {
    "a": (0.0, 0.0, 220.0, 0.0, 0.0, 0.0),
    "b": (20.0, 0.0, 220.0, 0.0, 0.0, 0.0),
    "c": (-15.0, 10.0, 220.0, 0.0, 0.0, 0.1),
}


@pytest.fixture(scope="module")
def dial() -> Iterator[Mock]:
    mock = start_mock("--gauge", "dial", "--seed", "4")
    yield mock
    mock.end()


@pytest.fixture
def at_the_plate(dial: Mock) -> Mock:
    dial.hands("clear")
    return dial


def begin(site: Site, folder: Path, *hear: Hear, poses: Any = PLACES, **kind: Any) -> Session:
    return begun(site, poses, folder, *hear, **kind)


async def test_a_plate_is_touched_at_every_place_and_left_upwards(
    at_the_plate: Mock, heard: Heard, tmp_path: Path
) -> None:
    run_folder = await run(begin(at_the_plate.site, tmp_path, heard))
    found = read_run(run_folder).run
    read = [pose for pose, there in zip(found.pose, found.measured, strict=True) if there]
    assert read == ["a", "b", "c", "a"]
    for at in np.flatnonzero(found.measured):
        label = found.pose[at]
        assert found.pose[at - 1] in (f"{label}+", f"{label}^")  # from above, or after a raise
        assert found.pose[at + 1] == f"{label}+"
    said = heard.said()
    assert "raised by 0.3 mm it changed by" in said
    truth = at_the_plate.hands("truth")["parameters"]
    assert truth  # the plate is 0.25 mm higher and inclined: no number is where it was drawn
    assert np.all(np.abs(found.position[0, found.measured]) > 0.01)
    assert np.ptp(found.position[0, found.measured][[0, 3]]) < 0.006  # its zero stays


FAULTS = {
    "gauge-held": "it repeats its number",
    "gauge-inch-untold": "a thousand times|inches|millimetres and inches|mm from where",
    "gauge-over": "OVER RANGE",
    "gauge-silent": "no line for 2 s",
    "gauge-reversed": "from where the machine should be|can show",
}


@pytest.mark.parametrize(
    "fault",
    [one if one == "gauge-held" else pytest.param(one, marks=pytest.mark.long) for one in FAULTS],
)
async def test_what_a_gauge_does_in_the_middle_ends_in_words_and_the_session_goes_on(
    fault: str, at_the_plate: Mock, heard: Heard, tmp_path: Path
) -> None:
    mock = at_the_plate
    session = begin(mock.site, tmp_path, once_read(2, lambda: mock.hands("fault", name=fault)))
    with pytest.raises(DeviceError, match=f"(?i){FAULTS[fault]}"):
        await run(session)
    mock.hands("clear")
    again = Session.reopen(session.folder, unattended=True)
    found = read_run(await run(again)).run
    read = [pose for pose, there in zip(found.pose, found.measured, strict=True) if there]
    assert read == ["a", "b", "c", "a"]
    assert np.ptp(found.position[0, found.measured]) < 0.2


async def test_lines_that_are_garbage_or_in_inches_cost_nothing(
    at_the_plate: Mock, heard: Heard, tmp_path: Path
) -> None:
    mock = at_the_plate
    site = mock.site
    session = begin(
        site, tmp_path, heard, once_read(1, lambda: mock.hands("fault", name="gauge-noise")),
        once_read(3, lambda: mock.hands("fault", name="gauge-inch")),
    )  # fmt: skip
    found = read_run(await run(session)).run
    values = found.position[0, found.measured]
    assert values[3] == pytest.approx(values[0], abs=0.01)
    assert "its lines are in in now, before in mm" in heard.said()


async def test_a_sign_that_is_wrong_is_found_at_the_first_place(
    at_the_plate: Mock, tmp_path: Path
) -> None:
    text = at_the_plate.site.to_toml().replace("sign = -1", "sign = 1")
    text = text.replace("zero_at = 6.35", "zero_at = -6.35")
    with pytest.raises(DeviceError, match=r"counts the other way.*Write the other sign"):
        await run(begin(parse_site(text, "site.toml", tmp_path), tmp_path))


@pytest.mark.long
async def test_a_bar_is_read_between_nests_wherever_it_is_in_range(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--gauge", "bar", "--seed", "4")
    site = mock.site
    assert site.gauge is not None
    poses = {"a": (0.0, 0.0, 220.0, 0.0, 0.0, 0.0), "b": (5.0, -5.0, 216.0, 0.0, 0.05, 0.1)}
    found = read_run(await run(begin(site, tmp_path, heard, poses=poses))).run
    assert found.sensing is not None
    taken = heard.of(ev.NumberTaken)
    assert len(taken) >= 4
    assert {(one.nest, one.nest2) for one in taken} <= set(site.gauge.pairs)
    for one in taken:
        assert abs(one.value - site.gauge.zero_at) < 25.0
        assert abs(one.value - one.expected) < 1.0 + BAR_WRONG_MM
    assert found.header.setup is not None
    assert found.header.setup.instruments["bar"].zero_sigma == 0.1


def typed_site(folder: Path, more: str = "") -> Site:
    text = f"""format = "pkm-site/1"
machine = "delta"
[controller]
kind = "operator"
[gauge]
kind = "operator"
reads = "distance"
sigma = 0.02
name = "calipers"
{more}
[nests.platform]
tool = {{ at = [0.0, 0.0, 0.0], sigma = 0.3 }}
"""
    return parse_site(text, "site.toml", folder)


MARKS = {"a": (0.0, 0.0, 100.0, 0.0, 0.0, 0.0), "b": (40.0, 30.0, 100.0, 0.0, 0.0, 0.0)}


def person(session: Session, numbers: list[str], asked: list[str]) -> Callable[[ev.Event], None]:
    """Says done, and types these numbers one after the other."""

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.PromptNeeded):
            asked.append(event.text)
            number = "what does the gauge show" in event.text or "read again" in event.choices
            answer = numbers.pop(0) if number else event.choices[0]
            if answer == "STOP":
                asyncio.get_running_loop().create_task(session.stop())
            else:
                session.answer_prompt(event.prompt, answer)

    return hear


async def test_marks_are_left_and_measured_with_calipers_that_a_person_reads(
    tmp_path: Path,
) -> None:
    site = typed_site(tmp_path)
    plan = measure_plan(site, MARKS, PlanOptions(warm_up=False, marks=(("a", "b"),)))
    asked: list[str] = []
    session = Session.create(site, plan, tmp_path)
    session.observers.watch(person(session, ["5,01", "STOP"], asked))
    with pytest.raises(StoppedByOperator):
        await run(session)
    assert any('"5,01" is no number' in text for text in asked)
    again = Session.reopen(session.folder)
    again.observers.watch(person(again, ["5.01", "take 50.1", "50.01"], asked))
    try:
        outcome = await again.run()
    finally:
        await again.close()
    found = read_run(outcome.run_folder).run
    assert found.sensing is not None
    at = int(np.flatnonzero(found.measured)[0])
    assert found.position[0, at] == pytest.approx(50.1)  # the decimal point, one place
    assert found.pose[found.sensing.ends[1, at]] == "b"
    assert "tool" in found.header.setup.nests  # type: ignore[union-attr]


REFUSED = {
    'reads = "distance"\n': ('reads = "height"\n', "reads"),
    "sigma = 0.02": ("sigma = 0.0", "sigma is 0"),
    'name = "calipers"': ('nest = "tool"', "a distance has pairs"),
    'kind = "operator"\nreads': ('kind = "operator"\nunit = "deg"\nreads', "not in deg"),
}


@pytest.mark.parametrize("right", REFUSED)
def test_a_gauge_that_cannot_be_is_refused_with_its_line(right: str, tmp_path: Path) -> None:
    wrong, says = REFUSED[right]
    text = typed_site(tmp_path).to_toml()
    good = """format = "pkm-site/1"
machine = "delta"
[controller]
kind = "operator"
[gauge]
kind = "operator"
reads = "distance"
sigma = 0.02
name = "calipers"
[nests.platform]
tool = [0.0, 0.0, 0.0]
"""
    assert text
    with pytest.raises(BadInput, match=says) as refused:
        parse_site(good.replace(right, wrong), "site.toml", tmp_path)
    assert "line" in str(refused.value) or ":" in refused.value.place


def test_what_needs_a_tracker_says_so_at_a_site_with_a_gauge(tmp_path: Path) -> None:
    site = typed_site(tmp_path)
    with pytest.raises(BadInput, match="a gauge cannot verify"):
        measure_plan(site, MARKS, OPTIONS, "verify")
    with pytest.raises(BadInput, match="needs a tracker"):
        _ = site.tracker


@pytest.mark.skipif(os.name == "nt", reason="there are no pseudo terminals")
async def test_a_gauge_on_a_serial_line_in_the_words_of_its_makers() -> None:
    from drivers.kind import Surroundings
    from drivers.lines.gauge_kind import KIND
    from mocks.gcs.pseudo_terminal import PseudoTerminal

    said = [b"01A+00012.345\r\n", b"1,5 mm\r\n", b"+1.0E-01\r\n", b'0.5 "\r\n', b"91n\r\n"]
    line = PseudoTerminal()

    async def read(unit: str, decimal: str, text: bytes) -> float:
        stated = {
            "source": line.path, "link": "serial", "unit": unit, "decimal": decimal, "each": "key",
        }  # fmt: skip
        settings = {one.name: stated.get(one.name, one.default) for one in KIND.settings}
        gauge = await KIND.open(Surroundings(settings, "", "delta", (), {}))
        asyncio.get_running_loop().call_later(0.1, line.write, text)
        try:
            return (await gauge.read(0.1)).value
        finally:
            await gauge.close()

    assert await read("mm", ".", said[0]) == pytest.approx(12.345)
    assert await read("in", ",", said[1]) == pytest.approx(1.5)  # the line says mm
    assert await read("in", ".", said[2]) == pytest.approx(2.54)
    assert await read("mm", ".", said[3]) == pytest.approx(12.7)
    with pytest.raises(DeviceError, match="holds no number"):
        await read("mm", ".", said[4])
    line.close()
