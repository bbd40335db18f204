"""An adapter that loses frames or falls silent, between the driver and the station."""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from drivers.canopen import CanopenController
from drivers.errors import HeartbeatLost

HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)


class Middleman:
    """Passes slcan lines on, except those that ``loses`` says are lost on the way to the PC."""

    def __init__(self, channel: str) -> None:
        host, port = channel.removeprefix("socket://").split(":")
        self.loses: Callable[[bytes], bool] = lambda line: False
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
                kept = [line + b"\r" for line in lines if not self.loses(line)]
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
