"""A probe that only says whether it touches drives a session; and what goes wrong with it."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from session_gauges import Hear, begun, once_read, run
from session_mock import Heard, Mock, start_mock

from app.files.runs import read_run
from app.files.site import Site, parse_site
from app.files.site_probe import Search
from app.session import events as ev
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from calib.errors import BadInput
from drivers.errors import DeviceError, NoNumber
from drivers.lines.contact import OPEN, TOUCHES, ContactPattern, ContactProbe
from drivers.lines.source import TcpSource
from mocks.gauge import (
    BALL_MM,
    PLATE_BELOW_MM,
    PLATE_OFF_MM,
    PLATE_TILT,
    REPEATS_MM,
    TRAVEL_MM,
)

FINE_MM = 0.02
Z = 220.0 - PLATE_BELOW_MM
PLACES = {"a": (0.0, 0.0, Z, 0.0, 0.0, 0.0), "b": (12.0, -6.0, Z, 0.0, 0.0, 0.05)}


@pytest.fixture(scope="module")
def probe() -> Iterator[Mock]:
    mock = start_mock("--gauge", "touch", "--seed", "4")
    yield mock
    mock.end()


def site_of(mock: Mock, folder: Path, **more: float) -> Site:
    """Short searches, so that a session is soon over."""
    mock.hands("clear")
    keys = {"clearance_mm": 1.5, "fine_mm": FINE_MM, "step_mm": 0.4, **more}
    text = mock.site.to_toml().replace("clearance_mm = 3.0\n", "")
    own = "".join(f"{key} = {value}\n" for key, value in keys.items())
    return parse_site(text.replace("[gauge]\n", f"[gauge]\n{own}"), "site.toml", folder)


def begin(site: Site, folder: Path, *hear: Hear) -> Session:
    return begun(site, PLACES, folder, *hear)


async def test_a_place_is_latched_where_the_ball_has_just_been_pushed_in(
    probe: Mock, heard: Heard, tmp_path: Path
) -> None:
    site = site_of(probe, tmp_path)
    above: list[float] = []

    def ask_the_mock(event: ev.Event) -> None:
        if isinstance(event, ev.NumberTaken):
            true = probe.hands("truth")
            nest = np.array(true["position"]) + np.array(true["rotation"]) @ NEST
            normal = np.array([*PLATE_TILT, 1.0]) / np.linalg.norm([*PLATE_TILT, 1.0])
            above.append(float(normal @ (nest - [0.0, 0.0, through + PLATE_OFF_MM])))

    NEST = np.array(site.platform_nests[site.gauge.nest])  # type: ignore[union-attr]
    through = site.setup.planes["plate"].through[2]  # type: ignore[union-attr]
    found = read_run(await run(begin(site, tmp_path, heard, ask_the_mock))).run
    assert len(above) == 3
    pushed = BALL_MM - TRAVEL_MM - np.array(above)
    assert np.all((pushed > -5.0 * REPEATS_MM) & (pushed < FINE_MM + 5.0 * REPEATS_MM))
    read = np.flatnonzero(found.measured)
    assert [found.pose[k] for k in read] == ["a", "b", "a"]
    assert np.all(found.position[0, read] == BALL_MM)
    assert np.sqrt(found.covariance[0, 0, read]) == pytest.approx(
        np.hypot(0.001, FINE_MM / 12**0.5)
    )
    # It comes from above: the last step before each contact is the finest one, downwards.
    last = found.q[:, read] - found.q[:, read - 1]
    assert np.all(last < 0.0)
    assert np.abs(last).max() < 2.0 * FINE_MM
    again = heard.of(ev.DriftChecked)
    assert again
    assert again[-1].shift_mm <= 1.01 * FINE_MM


FAULTS = {
    "gauge-dead": r"touched nothing down to 2 mm below the place.*below_mm",
    "gauge-held": r"touched nothing|says that it touches|still says that it touches",
    "gauge-silent": "no line for 2 s",
}


@pytest.mark.parametrize(
    "fault",
    [one if one == "gauge-dead" else pytest.param(one, marks=pytest.mark.long) for one in FAULTS],
)
async def test_what_a_probe_does_in_the_middle_ends_in_words_and_the_session_goes_on(
    fault: str, probe: Mock, tmp_path: Path
) -> None:
    site = site_of(probe, tmp_path)

    session = begin(site, tmp_path, once_read(1, lambda: probe.hands("fault", name=fault)))
    with pytest.raises(DeviceError, match=FAULTS[fault]):
        await run(session)
    probe.hands("clear")
    again = Session.reopen(session.folder, unattended=True)
    found = read_run(await run(again)).run
    assert [p for p, there in zip(found.pose, found.measured, strict=True) if there] == list("aba")


async def test_a_surface_far_from_the_drawing_is_doubted(probe: Mock, tmp_path: Path) -> None:
    site = site_of(probe, tmp_path, near=0.05, below_mm=1.0)
    with pytest.raises(DeviceError, match=r"touched .* mm from where the drawing has the surface"):
        await run(begin(site, tmp_path))


def test_steps_of_a_search_end_in_the_finest() -> None:
    assert Search(0.5, 0.01, 2.0, 0.0).steps == pytest.approx((0.5, 0.05, 0.01))
    assert Search(0.5, 0.5, 2.0, 0.0).steps == (0.5,)
    assert Search(1.0, 0.002, 2.0, 0.0).steps == pytest.approx((1.0, 0.1, 0.01, 0.002))


GOOD = """format = "pkm-site/1"
machine = "hexapod"
[controller]
kind = "operator"
[gauge]
kind = "contact"
source = "127.0.0.1:9"
touches = "TRIGGERED"
open = "open"
reads = "direction"
plane = "plate"
sigma = 0.002
[planes.plate]
normal = [0.0, 0.0, 1.0]
through = [0.0, 0.0, 200.0]
[nests.platform]
tool = [0.0, 0.0, 0.0]
"""
REFUSED = {
    'plane = "plate"\n': ("", "needs a plane"),
    'reads = "direction"\nplane = "plate"\n': ('reads = "tilt"\n', "a contact is no tilt"),
    "sigma = 0.002": ("sigma = 0.002\nzero_at = 1.0", "zero_at says nothing of it"),
    "sigma = 0.002\n": ("sigma = 0.002\nfine_mm = 1.0\n", "the smaller ones"),
    'touches = "TRIGGERED"': ('touches = "(x"', "no pattern"),
    'open = "open"': ('open = "(open)?"', "found in every line"),
    'open = "open"\n': ("", "open"),
}


@pytest.mark.parametrize("right", REFUSED)
def test_a_probe_that_cannot_be_is_refused_with_its_line(right: str, tmp_path: Path) -> None:
    assert parse_site(GOOD, "site.toml", tmp_path).gauge is not None
    wrong, says = REFUSED[right]
    with pytest.raises(BadInput, match=says) as refused:
        parse_site(GOOD.replace(right, wrong, 1), "site.toml", tmp_path)
    assert "line" in str(refused.value)


def test_a_machine_that_cannot_be_lowered_has_no_probe(tmp_path: Path) -> None:
    site = parse_site(GOOD.replace("sigma =", "clearance_mm = 0.0\nsigma ="), "s.toml", tmp_path)
    with pytest.raises(BadInput, match="must be lowered"):
        measure_plan(site, PLACES, PlanOptions(warm_up=False))


async def test_lines_of_a_probe_say_one_of_both_or_are_no_reading() -> None:
    said: list[bytes] = []
    served: list[Any] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        served.append(writer)
        while await reader.readline():
            writer.write(b"ok\r\n" + said.pop(0) + b"\r\n")

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    host, port = server.sockets[0].getsockname()[:2]
    source = await TcpSource.open(f"{host}:{port}", "probe")
    probe = ContactProbe(source, ContactPattern("TRIG", "open", "^ok"), "?\n", 0.3, "probe")
    said += [b"z_probe: TRIGGERED", b"z_probe: open", b"TRIG open", b"\xff#7", b""]
    assert [(await probe.read(0.0)).value for _ in range(2)] == [TOUCHES, OPEN]
    assert (await probe.state()).ready
    for _ in range(2):
        with pytest.raises(NoNumber, match="neither that it touches"):
            await probe.read(0.0)
    with pytest.raises(DeviceError, match=r"no line for 0\.3 s"):
        await probe.read(0.0)
    await probe.close()
    server.close()
    served[0].transport.abort()
