"""A tracker that does nothing but say where its SMR is: ``x y z`` lines on TCP, mm.

It follows SMR 1 wherever it is carried, has no command, no weather and no second face. A line
``lost`` says that nobody holds the SMR into its beam.
"""

import asyncio
from contextlib import suppress

import numpy as np

from mocks.clock import ScaledClock
from mocks.smrs import HAND
from mocks.tracker.sensor import Sensor
from mocks.world import World

LINES_PER_WALL_S = 400.0
SMR = "smr1"


class LineServer:
    """Sends lines to every client of ``host:port`` (port 0: any free one)."""

    def __init__(
        self, world: World, clock: ScaledClock, host: str = "127.0.0.1", port: int = 0
    ) -> None:
        self._world, self._clock = world, clock
        self._sensor = Sensor(world)
        self._host, self._port = host, port
        self._server: asyncio.Server | None = None
        self._clients: set[asyncio.StreamWriter] = set()

    @property
    def address(self) -> str:
        """``host:port``."""
        return f"{self._host}:{self._port}"

    async def start(self) -> None:
        """Listen."""
        self._server = await asyncio.start_server(self._serve, self._host, self._port)
        self._port = self._server.sockets[0].getsockname()[1]

    async def stop(self) -> None:
        """Close everything."""
        if self._server is not None:
            self._server.close()
        for client in self._clients:
            client.transport.abort()

    async def _serve(self, _reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients.add(writer)
        try:
            with suppress(OSError):
                while not writer.is_closing():
                    await asyncio.sleep(1.0 / LINES_PER_WALL_S)
                    if "tracker-silent" not in self._world.faults:
                        writer.write(self.line().encode("ascii"))
                        await writer.drain()
        finally:
            self._clients.discard(writer)
            writer.close()

    def line(self) -> str:
        """What it says now."""
        if "tracker-lost" in self._world.faults or self._world.smrs.places[SMR] == HAND:
            return "lost\n"
        now = np.array([self._clock.now()])
        x, y, z = self._sensor.samples(SMR, now)[0]
        return f"{x:.4f} {y:.4f} {z:.4f}\n"
