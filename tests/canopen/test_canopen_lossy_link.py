"""An adapter that loses frames or falls silent, between the driver and the station."""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen import CanopenController
from drivers.canopen.slcan_bus import is_whole
from drivers.errors import HeartbeatLost, LinkLost, ProtocolError
from drivers.interface import Alarm
from mocks.canopen.slcan import Frame, encode

HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)


class Middleman:
    """Passes slcan lines on to the PC, but for those that ``loses`` names, as ``garbles`` says."""

    def __init__(self, channel: str) -> None:
        host, port = channel.removeprefix("socket://").split(":")
        self.loses: Callable[[bytes], bool] = lambda line: False
        self.garbles: Callable[[bytes], bytes] = lambda line: line
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.channel = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self._far = socket.create_connection((host, int(port)))
        self._near: socket.socket | None = None
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        with contextlib.suppress(OSError):
            self._near, _ = self._listener.accept()
            threading.Thread(target=self._to_station, daemon=True).start()
            pending = b""
            while data := self._far.recv(4096):
                *lines, pending = (pending + data).split(b"\r")
                kept = [self.garbles(line + b"\r") for line in lines if not self.loses(line)]
                self._near.sendall(b"".join(kept))

    def _to_station(self) -> None:
        with contextlib.suppress(OSError):
            assert self._near is not None
            while data := self._near.recv(4096):
                self._far.sendall(data)

    def close(self) -> None:
        for end in (self._listener, self._far, self._near):
            if end is not None:
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
                end.close()


@pytest.fixture
def middleman(station) -> Iterator[Middleman]:
    middleman = Middleman(station.channel)
    yield middleman
    middleman.close()


@pytest.mark.long
@pytest.mark.parametrize("lost", [b"t18A", b"t28A"])
async def test_lost_frame_costs_time_and_nothing_else(middleman: Middleman, lost: bytes):
    controller = await CanopenController.connect("slcan", middleman.channel)
    await controller.enable()
    middleman.loses = lambda line: line.startswith(lost)
    targets = await controller.move_to_pose(HOME)
    assert targets == pytest.approx([230.7148097226] * 6, abs=1e-9)
    await controller.wait_arrived(20.0)
    middleman.loses = lambda line: False
    await controller.close()


@pytest.mark.long
async def test_silent_adapter_is_noticed_by_the_heartbeats(station, middleman: Middleman):
    controller = await CanopenController.connect("slcan", middleman.channel, silence_s=0.6)
    await controller.enable()
    noticed = asyncio.Event()
    controller.on_alarm(lambda alarm: noticed.set())
    middleman.loses = lambda line: True
    await asyncio.wait_for(noticed.wait(), 20.0)
    with pytest.raises(HeartbeatLost):
        controller.check()
    await controller.close()


GARBLED = {
    "another sign": lambda line: line[:6] + b"g" + line[7:],
    "cut short": lambda line: line[:6] + b"\r",
    "no length": lambda line: line[:4] + b"\r",
    "wrong length": lambda line: line[:4] + b"9" + line[5:],
    "two in one": lambda line: line[:-1] + line,
    "not of ASCII": lambda line: line[:6] + b"\xff" + line[7:],
    "without an end": lambda line: b"0" * 5000 + b"\r",
}


@pytest.mark.long
async def test_damaged_frames_are_ignored_counted_and_told(
    middleman: Middleman, capfd: pytest.CaptureFixture[str]
):
    controller = await CanopenController.connect("slcan", middleman.channel)
    told: list[Alarm] = []
    controller.on_alarm(told.append)
    await controller.enable()
    left = list(GARBLED.values())

    def garble(line: bytes) -> bytes:
        return left.pop()(line) if left and line.startswith(b"t70") else line  # a heartbeat

    middleman.garbles = garble
    await controller.move_to_pose(HOME)
    await controller.wait_arrived(20.0)
    async with asyncio.timeout(20.0):
        while controller._bus.link.reader.damaged < len(GARBLED):  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    assert await controller.read_parameters()
    controller.check()
    assert any("damaged frame" in alarm.what and not alarm.fault for alarm in told)
    await controller.close()
    assert "Traceback" not in capfd.readouterr().err


async def test_an_answer_of_another_size_than_the_object_has_is_refused(middleman: Middleman):
    controller = await CanopenController.connect("slcan", middleman.channel)
    # The first of several frames (0x41) becomes the only one (0x43), with four bytes of eight.
    middleman.garbles = lambda line: line.replace(b"t58A8411224", b"t58A8431224")
    with pytest.raises(ProtocolError, match="another size") as refused:
        await controller.state()
    assert "controller" in refused.value.device
    assert "EDS" in refused.value.remedy
    middleman.garbles = lambda line: line
    assert len((await controller.state()).actuators) == 6
    await controller.close()


@pytest.mark.long
async def test_line_that_garbles_everything_is_lost_in_words_and_the_machine_stops(
    station, middleman: Middleman, capfd: pytest.CaptureFixture[str]
):
    controller = await CanopenController.connect("slcan", middleman.channel)
    await controller.enable()
    await controller.move_to_pose((10.0, -10.0, 225.0, 0.05, 0.05, 0.05))
    noticed = asyncio.Event()
    controller.on_alarm(lambda alarm: noticed.set() if alarm.fault else None)
    middleman.garbles = lambda line: b"".join([line[:3] + b"\xfe" + line[4:]] * 20)
    await asyncio.wait_for(noticed.wait(), 20.0)
    with pytest.raises(LinkLost, match="damaged frames within"):
        controller.check()
    async with asyncio.timeout(20.0):
        while await asyncio.to_thread(lambda: station.moving):  # noqa: ASYNC110
            await asyncio.sleep(0.02)
    await controller.close()
    said = capfd.readouterr().err
    assert "Traceback" not in said
    assert "utf-8" not in said


async def test_link_that_goes_is_told_without_the_library_s_traceback(
    middleman: Middleman, capfd: pytest.CaptureFixture[str]
):
    controller = await CanopenController.connect("slcan", middleman.channel)
    noticed = asyncio.Event()
    controller.on_alarm(lambda alarm: noticed.set())
    middleman.close()
    await asyncio.wait_for(noticed.wait(), 20.0)
    with pytest.raises(LinkLost, match="the link is gone"):
        controller.check()
    await controller.close()
    assert capfd.readouterr().err == ""


@given(st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans(), st.sampled_from(["", "1A2B"]))
def test_whole_lines_are_frames_and_parts_of_them_are_not(
    number: int, data: bytes, extended: bool, time: str
):
    line = encode(Frame(number, data, extended))[:-1].decode()
    assert is_whole(line + time)
    for end in range(1, len(line)):
        short = len(line) - end
        if short not in (0, 4):  # as long as with a time stamp less
            assert not is_whole(line[:end]) or end < 2
