import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from gcs_bench import Bench, SmallMachine, running, tcp_port

from drivers.gcs import GcsController
from mocks.gcs.server import GcsStation

LINES = [
    "tcp",
    pytest.param("pty", marks=pytest.mark.skipif(sys.platform == "win32", reason="no pty")),
]


@pytest.fixture(params=LINES)
async def bench(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Bench]:
    """A connected driver, once over TCP and once over a serial line."""
    world, nvm = SmallMachine(), tmp_path / "nvm.json"
    with running(GcsStation(world, nvm, serial=77)) as station:
        port = tcp_port(station) if request.param == "tcp" else station.pty_path
        made = Bench(world, station, nvm, port)
        await made.connect()
        yield made
        await made.driver.close()


@pytest.fixture
def controller(bench: Bench) -> GcsController:
    return bench.driver
