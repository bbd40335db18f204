"""Against an independent implementation: the CESAPI package (MIT), as client and as simulator."""

import asyncio
import logging
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from tracker_bench import Bench

from drivers.emscon.link import EmsconLink
from drivers.errors import DeviceError

pytest.importorskip("CESAPI")

from CESAPI.command import CommandSync
from CESAPI.connection import Connection
from CESAPI.test import LTSimulator


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    """The package sets the root logger to DEBUG."""
    for name in ("CESAPI.test", "CESAPI.connection", "CESAPI.command"):
        logging.getLogger(name).setLevel(logging.WARNING)
    yield
    logging.getLogger().setLevel(logging.WARNING)


@contextmanager
def foreign_client(address: str) -> Iterator[CommandSync]:
    host, _, port = address.rpartition(":")
    connection = Connection()
    connection.connect(host=host, port=int(port))
    try:
        yield CommandSync(connection)
    finally:
        connection.disconnect()


async def _with_foreign_client(bench: Bench, work: Callable[[CommandSync], Any]) -> Any:
    await bench.tracker.close()

    def run() -> Any:
        with foreign_client(bench.server.address) as client:
            return work(client)

    return await asyncio.to_thread(run)


@pytest.mark.long
async def test_foreign_client_measures_on_our_mock(bench: Bench) -> None:
    nest = bench.nest("3")

    def work(client: CommandSync) -> Any:
        client.Initialize()
        client.SetReflector(1)
        x, y, z = (1e-3 * value for value in nest)  # the tracker speaks metres until told
        client.GoPosition(int(True), x, y, z)
        return client.StartMeasurement()

    result = await _with_foreign_client(bench, work)
    assert result.packetInfo.status == 0
    seen = np.array([result.dVal1, result.dVal2, result.dVal3])
    assert seen == pytest.approx(np.array(nest) * 1e-3, abs=5e-5)
    assert 1e-6 < result.dAprioriStdTotal < 1e-4


async def test_foreign_client_is_refused_before_initialisation(bench: Bench) -> None:
    with pytest.raises(Exception, match="failed with status 39"):
        await _with_foreign_client(bench, lambda client: client.StartMeasurement())


async def test_foreign_client_reads_states_of_our_mock(bench: Bench) -> None:
    def work(client: CommandSync) -> Any:
        return client.GetSystemStatus(), client.GetEnvironmentParams()

    status, air = await _with_foreign_client(bench, work)
    assert status.lTrackerSerialNumber == 390793
    assert 900.0 < air.environmentData.dPressure < 1100.0


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def simulator() -> Iterator[LTSimulator]:
    server = LTSimulator()
    server.host, server.port = "127.0.0.1", _free_port()
    server.start()
    yield server
    server.stop()
    server.join(5.0)


async def test_our_link_frames_as_the_foreign_simulator_does(simulator: LTSimulator) -> None:
    link = await _open(simulator)
    try:
        status = await link.ask("GetSystemStatus", 3.0)
        assert status.integer("serial") == 390793
        assert (await link.ask("Initialize", 3.0)).status == 0
        await link.ask("SetStationaryModeParams", 3.0, time_ms=500, use_adm=1)
        air = await link.ask("GetEnvironmentParams", 3.0)
        assert air.real("pressure") == pytest.approx(1013.25)
        reflectors = await link.ask_many("GetReflectors", 3.0)
        assert reflectors[0].text("name") == "Rocinante"
        assert (await link.ask("GetFace", 3.0)).integer("face") == 1
        await link.ask("SetUnits", 3.0, length=1, angle=0, temperature=0, pressure=1, humidity=0)
        await link.ask("StartMeasurement", 3.0)
    finally:
        await link.close()


async def _open(simulator: LTSimulator) -> EmsconLink:
    """Connect as soon as the simulator's thread listens."""
    for _ in range(50):
        try:
            return await EmsconLink.open(simulator.host, simulator.port, 1.0)
        except DeviceError:
            await asyncio.sleep(0.05)
    raise AssertionError("the simulator did not start")
