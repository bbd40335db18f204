"""Lines on a serial port, in a file that grows, one by one when asked: the laws, and the faults."""

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path

import pytest

from drivers.contract import TRACKER_LAWS, Law, TrackerBench, why_not
from drivers.errors import BeamBroken, ConnectFailed, LinkLost, NotReady, Refused, Silence
from drivers.interface import Tracker
from drivers.kind import Surroundings
from drivers.lines.kind import KIND
from drivers.lines.reading import PLAIN, LinePattern, fault_in
from mocks.gcs.pseudo_terminal import PseudoTerminal

LONGEST_S = 20.0
SMR = "-1170.4016 1087.6680 85.3035"
Connect = Callable[[], Awaitable[Tracker]]


def opener(**stated: object) -> Connect:
    stated = {"unit": "mm", "sigma_mm": 0.01, "silence_s": 1.0, **stated}
    settings = {one.name: stated.get(one.name, one.default) for one in KIND.settings}

    async def connect() -> Tracker:
        return await KIND.open(Surroundings(settings, "", "hexapod", (), {}, 200.0))

    return connect


@contextlib.asynccontextmanager
async def sending(write: Callable[[str], None], connect: Connect) -> AsyncIterator[TrackerBench]:
    """A bench whose instrument writes lines until somebody steps into its beam or cuts it off."""
    said: dict[str, str | None] = {"line": SMR}

    async def pump() -> None:
        while True:
            await asyncio.sleep(0.005)
            if said["line"] is not None:
                write(f"{said['line']}\r\n")

    async def hide() -> None:
        said["line"] = "no target"

    async def silence() -> None:
        said["line"] = None

    task = asyncio.ensure_future(pump())
    try:
        yield TrackerBench(connect, LONGEST_S, None, hide, silence)
    finally:
        task.cancel()


@contextlib.asynccontextmanager
async def serial_bench(folder: Path) -> AsyncIterator[TrackerBench]:
    line = PseudoTerminal()
    connect = opener(source=line.path, link="serial")
    try:
        async with sending(lambda text: line.write(text.encode()), connect) as bench:
            yield bench
    finally:
        line.close()


@contextlib.asynccontextmanager
async def file_bench(folder: Path) -> AsyncIterator[TrackerBench]:
    path = folder / "readings.txt"
    path.write_text("a program wrote this before\n1 2 3\n")

    def write(text: str) -> None:
        with path.open("a") as file:
            file.write(text)

    async with sending(write, opener(source=str(path), link="file")) as bench:
        yield bench


@pytest.mark.skipif(os.name == "nt", reason="there are no pseudo terminals")
@pytest.mark.parametrize("law", TRACKER_LAWS, ids=str)
@pytest.mark.parametrize("where", [serial_bench, file_bench], ids=["serial", "file"])
async def test_it_holds_the_laws(where, law: Law, tmp_path: Path) -> None:
    async with where(tmp_path) as bench:
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


@contextlib.asynccontextmanager
async def asked(answers: dict[str, str]) -> AsyncIterator[str]:
    """An instrument that answers commands, one a line; what it does not know it does not answer."""

    clients: list[asyncio.StreamWriter] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        clients.append(writer)
        writer.write(b"Instrument ready\n")
        while line := await reader.readline():
            writer.write(answers.get(line.decode().strip(), "").encode())
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield f"127.0.0.1:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()
        for client in clients:
            client.close()


async def test_a_reading_that_is_asked_for_is_one_line() -> None:
    async with asked({"READ?": "X=1,5;Y=-2,25;Z=0,125;U=0,012\n"}) as address:
        tracker = await opener(
            source=address, each="reading", ask="READ?\\n", unit="in", decimal=",",
            pattern=r"X=(?P<x>[^;]+);Y=(?P<y>[^;]+);Z=(?P<z>[^;]+);.*", ignore="ready",
        )()  # fmt: skip
        reading = await tracker.measure(3.0)
        assert reading.xyz == pytest.approx((38.1, -57.15, 3.175))
        assert reading.covariance[:3] == pytest.approx((1e-4,) * 3)
        assert not tracker.can.streams
        await tracker.close()


async def test_lines_that_state_their_sigma_are_believed() -> None:
    async with asked({"M": "1 2 3 0.1 0.2 0.3\n"}) as address:
        number = r"(?P<{}>\S+)"
        names = " ".join(number.format(name) for name in ("x", "y", "z", "sx", "sy", "sz"))
        tracker = await opener(
            source=address, each="reading", ask="M\\n", ignore="ready", pattern=names
        )()
        reading = await tracker.measure(1.0)
        assert reading.covariance == pytest.approx((0.01, 0.04, 0.09, 0.0, 0.0, 0.0))
        await tracker.close()


async def test_no_answer_is_silence_and_a_strange_one_is_no_reading() -> None:
    async with asked({"bad": "error 7\n"}) as address:
        for ask, fault in (("nobody\\n", Silence), ("bad\\n", BeamBroken)):
            tracker = await opener(
                source=address, each="reading", ask=ask, ignore="ready", silence_s=0.3
            )()
            with pytest.raises(fault):
                await tracker.measure(1.0)
            with pytest.raises(Refused):
                await tracker.point_at((0.0, 0.0, 0.0))
            await tracker.close()


async def test_a_file_that_is_begun_anew_is_read_from_its_beginning(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("1 1 1\n" * 100)
    tracker = await opener(source=str(path), link="file", each="reading")()
    dwell = asyncio.ensure_future(tracker.measure(1.0))
    await asyncio.sleep(0.2)
    path.write_text("4 5 6\n7 8")
    assert (await dwell).xyz == (4.0, 5.0, 6.0)
    dwell = asyncio.ensure_future(tracker.measure(1.0))
    await asyncio.sleep(0.2)
    assert not dwell.done()  # the line has no end yet
    with path.open("a") as file:
        file.write(" 9\n")
    assert (await dwell).xyz == (7.0, 8.0, 9.0)
    path.unlink()
    with pytest.raises(LinkLost):
        await tracker.measure(1.0)
    await tracker.close()


@pytest.mark.parametrize(
    "stated",
    [
        {"source": "127.0.0.1:1"},
        {"source": "nowhere"},
        {"source": "/dev/no-such-port", "link": "serial"},
        {"source": "no/such/file", "link": "file"},
    ],
)
async def test_what_is_not_there_is_said(stated: dict[str, str]) -> None:
    with pytest.raises(ConnectFailed):
        await opener(**stated)()


def test_patterns_find_three_numbers_however_they_are_parted() -> None:
    pattern = LinePattern(PLAIN, "mm", ".", "")
    for line in ("1 2.5 -3e1", " 1,2.5,-30 mm", "1;2.5;-30.0;17", "+1 , 2.5 , -30 # good"):
        reading = pattern.read(line)
        assert reading is not None
        assert reading.xyz == (1.0, 2.5, -30.0)
    for line in ("", "lost", "1 2", "1 2 nan", "1e999 2 3"):
        assert pattern.read(line) is None
    assert fault_in("(") != ""
    assert "(?P<z>" in fault_in("(?P<x>.)(?P<y>.)")
    assert fault_in(PLAIN) == ""


async def test_a_line_of_a_dwell_that_lost_a_digit_is_no_part_of_a_mean() -> None:
    line = PseudoTerminal()
    said = [SMR]

    async def pump() -> None:
        while True:
            await asyncio.sleep(0.002)
            line.write(f"{said.pop() if len(said) > 1 else SMR}\r\n".encode())

    task = asyncio.ensure_future(pump())
    tracker = await opener(source=line.path, link="serial")()
    try:
        dwell = asyncio.ensure_future(tracker.measure(20.0))
        await asyncio.sleep(0.03)
        said.append("-1170.4016 1087.6680 8.3035")
        with pytest.raises(NotReady, match="77 mm from the others"):
            await dwell
        assert (await tracker.measure(3.0)).xyz[2] == pytest.approx(85.3035)
    finally:
        task.cancel()
        await tracker.close()
        line.close()


@pytest.mark.parametrize("groups", [r"(?P<x>(\d+)+)", r"(?P<x>(.*)*)", r"(?P<x>(1|1.|11)*)"])
def test_a_pattern_that_takes_for_ever_is_refused_before_it_looks(groups: str) -> None:
    slow = groups + r" (?P<y>\d+) (?P<z>\d+)"
    assert "too long on a line" in fault_in(slow)
    ignore = next(one for one in KIND.settings if one.name == "ignore")
    assert ignore.check is not None
    assert "too long on a line" in ignore.check(slow)


def test_usual_patterns_are_quick() -> None:
    numbers = r"(?P<x>[-+.\d]+)\s+(?P<y>[-+.\d]+)\s+(?P<z>[-+.\d]+)"
    for pattern in (PLAIN, rf"\S+\s+{numbers}\s*", rf".*?{numbers}.*", rf"(?:\w+ )*{numbers}"):
        assert fault_in(pattern) == ""
    assert LinePattern(PLAIN, "mm", ".", "").read(SMR + " " * 400) is None
