"""A tracker that does nothing but say where its SMR is: ``x y z`` lines on TCP, mm.

It follows SMR 1 wherever it is carried, has no command, no weather and no second face. A line
``lost`` says that nobody holds the SMR into its beam.
"""

import asyncio

import numpy as np

from mocks.clock import ScaledClock
from mocks.listening import TcpDevice
from mocks.smrs import HAND
from mocks.tracker.sensor import Sensor
from mocks.world import World

LINES_PER_WALL_S = 400.0
SMR = "smr1"


class LineServer(TcpDevice):
    """Sends lines to every client of ``host:port`` (port 0: any free one)."""

    def __init__(
        self, world: World, clock: ScaledClock, host: str = "127.0.0.1", port: int = 0
    ) -> None:
        self._world, self._clock = world, clock
        self._sensor = Sensor(world)
        super().__init__(host, port)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer, or speak, as the device does."""
        while not writer.is_closing():
            await asyncio.sleep(1.0 / LINES_PER_WALL_S)
            if "tracker-silent" not in self._world.faults:
                writer.write(self.line().encode("ascii"))
                await writer.drain()

    def line(self) -> str:
        """What it says now."""
        if "tracker-lost" in self._world.faults or self._world.smrs.places[SMR] == HAND:
            return "lost\n"
        now = np.array([self._clock.now()])
        x, y, z = self._sensor.samples(SMR, now)[0]
        return f"{x:.4f} {y:.4f} {z:.4f}\n"
