"""The mock tracker's network side: one client at a time on TCP."""

import asyncio
from contextlib import suppress

from drivers.emscon import wire
from drivers.emscon.codes import UNKNOWN_COMMAND, Event, Status
from drivers.emscon.framing import Framer
from drivers.errors import ProtocolError
from mocks.clock import ScaledClock
from mocks.tracker.instrument import Instrument
from mocks.world import World

TAKEOVER_S = 0.3


class TrackerServer:
    """Serves one :class:`Instrument` on ``host:port`` (port 0: any free one)."""

    def __init__(
        self, world: World, clock: ScaledClock, host: str = "127.0.0.1", port: int = 0
    ) -> None:
        self.instrument = Instrument(world, clock)
        self._world = world
        self._host, self._port = host, port
        self._server: asyncio.Server | None = None
        self._client: asyncio.StreamWriter | None = None
        self._idle = asyncio.Event()
        self._idle.set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.instrument.send = self._send

    @property
    def address(self) -> str:
        """``host:port``."""
        return f"{self._host}:{self._port}"

    async def start(self) -> None:
        """Listen."""
        self._loop = asyncio.get_running_loop()
        self._server = await asyncio.start_server(self._serve, self._host, self._port)
        self._port = self._server.sockets[0].getsockname()[1]
        self._world.faults.subscribe(self._fault)

    async def stop(self) -> None:
        """Close everything."""
        self.instrument.measuring.interrupt()
        if self._server is not None:
            self._server.close()
        self.reset_connection()

    def reset_connection(self) -> None:
        """Cut the client off at once, without a word."""
        if self._client is not None:
            self._client.transport.abort()

    def _fault(self, name: str, present: bool) -> None:
        if name == "tracker-unsolicited-error" and present and self._loop is not None:
            self._world.faults.take(name)
            self._loop.call_soon_threadsafe(self.instrument.unsolicited, int(Status.NOT_STABLE))

    def _send(self, packet: bytes) -> None:
        silent = "tracker-silent" in self._world.faults
        if self._client is not None and not self._client.is_closing() and not silent:
            self._client.write(packet)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        # A client that was killed may still be on its way out.
        with suppress(TimeoutError):
            async with asyncio.timeout(TAKEOVER_S):
                await self._idle.wait()
        if self._client is not None:
            writer.write(wire.error(UNKNOWN_COMMAND, Status.MULTI_CONNECTION))
            writer.close()
            return
        self._client = writer
        self._idle.clear()
        try:
            await self._talk(reader)
        except (OSError, ProtocolError):
            writer.transport.abort()  # what a real server does with a client that talks nonsense
        finally:
            self.instrument.measuring.interrupt()
            self._client = None
            self._idle.set()
            writer.close()

    async def _talk(self, reader: asyncio.StreamReader) -> None:
        framer = Framer()
        if self.instrument.beam.locked is not None:
            self.instrument.event(Event.READY)
        while chunk := await reader.read(65536):
            for raw in framer.feed(chunk):
                await self.instrument.obey(wire.parse_request(raw))
