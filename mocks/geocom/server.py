"""GeoCOM on TCP: ``%R1Q,procedure,number:values`` and ``%R1P,0,number:code,values``."""

import asyncio
import re

from mocks.clock import ScaledClock
from mocks.geocom.instrument import TotalStationMock
from mocks.listening import TcpDevice
from mocks.world import World

_REQUEST = re.compile(r"%R1Q,(\d+)(?:,(\d+))?(?:,\d+)?:(.*)")
NOT_DECODED, UNAVAILABLE, WRONG_VALUES = 3080, 3081, 3078


class GeoComServer(TcpDevice):
    """A total station at ``host:port`` (port 0: any free one); one client after the other."""

    def __init__(
        self, world: World, clock: ScaledClock, host: str = "127.0.0.1", port: int = 0
    ) -> None:
        self._world, self._clock = world, clock
        self.instrument = TotalStationMock(world, clock)
        super().__init__(host, port)

    @property
    def address(self) -> str:
        """``socket://host:port``, as pyserial names it."""
        return f"socket://{super().address}"

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer, or speak, as the device does."""
        while line := await reader.readline():
            text = line.decode("latin-1").strip()
            if not text or "tracker-silent" in self._world.faults:
                continue
            writer.write((await self._answer(text) + "\r\n").encode("latin-1"))
            await writer.drain()

    async def _answer(self, text: str) -> str:
        request = _REQUEST.fullmatch(text)
        if request is None:
            return f"%R1P,{NOT_DECODED},0:0"
        procedure, number, rest = int(request[1]), request[2] or "0", request[3]
        known = self.instrument.procedures.get(procedure)
        if known is None:
            return f"%R1P,{UNAVAILABLE},{number}:0"
        try:
            values = [float(one) for one in rest.split(",") if one]
            wait_s, (code, answer) = known(values)
        except (ValueError, IndexError):
            return f"%R1P,{WRONG_VALUES},{number}:0"
        await asyncio.sleep(self._clock.wall(wait_s))
        return ",".join([f"%R1P,0,{number}:{code}", *answer])
