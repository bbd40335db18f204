"""A mock station in a process of its own, and the driver connected to it over TCP."""

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from canopen_bench import set_speed

from drivers.canopen import CanopenController
from drivers.errors import DeviceError
from drivers.interface import Alarm
from mocks.control import ControlClient

SCALE = 100


@dataclass
class Station:
    """Addresses of a running station and its back door."""

    channel: str
    hands: ControlClient
    nvm: Path

    def power_cycle(self) -> None:
        """Cut the power and wait until it is back."""
        self.hands("fault", name="power-cycle")
        deadline = time.monotonic() + 30.0
        while "power-cycle" in self.hands("faults")["faults"]:
            assert time.monotonic() < deadline
            time.sleep(0.005)

    def as_new(self) -> None:
        """End all faults, forget what was stored, switch off and on."""
        self.hands("clear")
        for leg in range(1, 7):
            self.hands("unstall", leg=leg)
        self.nvm.unlink(missing_ok=True)
        self.power_cycle()

    @property
    def moving(self) -> bool:
        """Whether any leg really moves."""
        return bool(self.hands("truth")["moving"])


@pytest.fixture(scope="session")
def running_station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    nvm = tmp_path_factory.mktemp("station") / "nvm.json"
    command = [sys.executable, "-m", "mocks.station", "hexapod", "--json", "--until-stdin-closes"]
    options = ["--scale", str(SCALE), "--seed", "3", "--nvm", str(nvm)]
    process = subprocess.Popen(
        [*command, *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        addresses = json.loads(process.stdout.readline())
        with ControlClient(addresses["control"]) as hands:
            yield Station(addresses["can"], hands, nvm)
    finally:
        process.stdin.close()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(10)
        process.stdout.close()


@pytest.fixture
def station(running_station: Station) -> Station:
    running_station.as_new()
    return running_station


@dataclass
class Connected:
    """A connected controller and what it has said unasked."""

    controller: CanopenController
    alarms: list[Alarm]


@pytest.fixture
async def connected(station: Station) -> AsyncIterator[Connected]:
    controller = await CanopenController.connect("slcan", station.channel, silence_s=1.2)
    alarms: list[Alarm] = []
    controller.on_alarm(alarms.append)
    yield Connected(controller, alarms)
    await controller.close()


@pytest.fixture
def controller(connected: Connected) -> CanopenController:
    return connected.controller


@pytest.fixture
async def slow(enabled: CanopenController) -> CanopenController:
    """An enabled controller at z = 206, whose moves from there take eight wall seconds."""
    await enabled.move_to_pose((0.0, 0.0, 206.0, 0.0, 0.0, 0.0))
    await enabled.wait_arrived(20.0)
    await set_speed(enabled, 0.05)
    return enabled


@pytest.fixture
async def enabled(controller: CanopenController) -> AsyncIterator[CanopenController]:
    await controller.enable()
    yield controller
    with contextlib.suppress(DeviceError):
        await controller.stop()
