"""The byte stream to one tracker: requests, their answers, and everything said unasked."""

import asyncio
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.emscon import wire
from drivers.emscon.codes import PacketType, status_words
from drivers.emscon.framing import Framer
from drivers.errors import ConnectFailed, DeviceError, LinkError, LinkLost, Refused, Silence

CHUNK = 65536
UNREAD_S = 0.05


@dataclass
class _Pending:
    """The one request that waits for its answer; ``answers`` collects those of GetReflectors."""

    code: int
    many: bool
    done: asyncio.Future[list[wire.Packet]]
    answers: list[wire.Packet] = field(default_factory=list)


class EmsconLink:
    """One TCP connection.

    Requests go one at a time and are matched to answers by command number. An Error packet
    belongs to the pending request only if it names its command: trackers send errors of their
    own accord. The listener sees every packet, answers included, in the order of arrival.
    """

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, device: str
    ) -> None:
        self.device = device
        self.lost: DeviceError | None = None
        self._reader = reader
        self._writer = writer
        self._pending: _Pending | None = None
        self._owed: deque[_Pending] = deque()
        self._turn = asyncio.Lock()
        self._on_packet: Callable[[wire.Packet], None] = lambda packet: None
        self._on_lost: Callable[[DeviceError], None] = lambda error: None
        self._closing = False
        self._task = asyncio.create_task(self._read(), name=f"read {device}")

    @classmethod
    async def open(cls, host: str, port: int, timeout: float = 5.0) -> "EmsconLink":
        """Connect within ``timeout`` wall seconds; raises ConnectFailed."""
        device = f"tracker {host}:{port}"
        try:
            async with asyncio.timeout(timeout):
                reader, writer = await asyncio.open_connection(host, port)
        except (OSError, TimeoutError) as error:
            raise ConnectFailed(
                f"nobody answers ({error or 'time-out'})",
                device=device,
                remedy="Check the address in the site file, the cable and the tracker's power.",
            ) from error
        return cls(reader, writer, device)

    def listen(
        self, on_packet: Callable[[wire.Packet], None], on_lost: Callable[[DeviceError], None]
    ) -> None:
        """Call ``on_packet`` for every packet and ``on_lost`` once when the link breaks."""
        self._on_packet = on_packet
        self._on_lost = on_lost

    async def ask(self, name: str, timeout: float, **values: wire.Value) -> wire.Packet:
        """Send a command and wait for its answer; raises Refused, Silence, LinkLost."""
        return (await self._exchange(name, timeout, False, values))[-1]

    async def ask_many(self, name: str, timeout: float) -> list[wire.Packet]:
        """Send a command whose answers carry their ``total`` number, and wait for all."""
        return await self._exchange(name, timeout, True, {})

    async def _exchange(
        self, name: str, timeout: float, many: bool, values: dict[str, wire.Value]
    ) -> list[wire.Packet]:
        async with self._turn:
            if self.lost is not None:
                raise self.lost
            future: asyncio.Future[list[wire.Packet]] = asyncio.get_running_loop().create_future()
            pending = self._pending = _Pending(wire.COMMANDS[name].code, many, future)
            try:
                self._writer.write(wire.request(name, **values))
                await asyncio.wait({future}, timeout=timeout)
                if not future.done():
                    # Where this very process was held up the answer may lie here unread.
                    await asyncio.wait({future}, timeout=UNREAD_S)
                if not future.done():
                    self._fall_silent(name, timeout)
                return future.result()
            except asyncio.CancelledError:
                if future.done():
                    future.exception()  # the answer came at that very moment; nobody waits for it
                else:
                    # It will still come, and must not be taken for that of a later request.
                    self._owed.append(pending)
                raise
            finally:
                self._pending = None

    def _fall_silent(self, name: str, timeout: float) -> None:
        """End the link: late answers could not be told from those to later requests."""
        self._break(
            Silence(
                f"no answer to {name} within {timeout:.1f} s",
                device=self.device,
                remedy="Check the tracker, then reconnect.",
            )
        )

    async def _read(self) -> None:
        framer = Framer()
        try:
            while chunk := await self._reader.read(CHUNK):
                for raw in framer.feed(chunk):
                    self._dispatch(wire.parse(raw))
            torn = f" in the middle of a packet ({framer.pending} bytes)" if framer.pending else ""
            self._break(self._gone(f"the tracker closed the connection{torn}"))
        except OSError as error:
            self._break(self._gone(f"the connection broke ({error})"))
        except DeviceError as error:  # of the parser, which does not know whose bytes they are
            self._break(type(error)(error.what, device=self.device, remedy=error.remedy))

    def _gone(self, what: str) -> LinkError:
        remedy = "Check the tracker and the network, then reconnect."
        return LinkLost(what, device=self.device, remedy=remedy)

    def _dispatch(self, packet: wire.Packet) -> None:
        self._on_packet(packet)
        owed = next((p for p in self._owed if p.code == packet.command), None)
        if owed is not None:
            self._settle(owed, packet)
            if owed.done.done():
                owed.done.exception()  # nobody waits for it any more
                self._owed.remove(owed)
        elif self._pending is not None and self._pending.code == packet.command:
            self._settle(self._pending, packet)

    def _settle(self, pending: _Pending, packet: wire.Packet) -> None:
        """Let a packet with the right command number answer a request."""
        if pending.done.done():
            return
        if packet.type == PacketType.ERROR or packet.status != 0:
            name = wire.BY_CODE[pending.code].name
            refused = Refused(
                f"{name}: {status_words(packet.status)}",
                device=self.device,
                remedy="See what the tracker's own program says; its state may forbid it.",
                code=packet.status,
            )
            pending.done.set_exception(refused)
        elif packet.type == PacketType.COMMAND:
            pending.answers.append(packet)
            if not pending.many or len(pending.answers) >= packet.integer("total"):
                pending.done.set_result(pending.answers)

    def _break(self, error: DeviceError) -> None:
        if self.lost is not None or self._closing:
            return
        self.lost = error
        self._writer.close()
        if self._pending is not None and not self._pending.done.done():
            self._pending.done.set_exception(error)
        self._on_lost(error)

    async def close(self) -> None:
        """Release the connection; never raises."""
        self._closing = True
        if self.lost is None:
            self.lost = LinkLost(
                "the connection was closed by this program",
                device=self.device,
                remedy="Connect again.",
            )
        if self._pending is not None and not self._pending.done.done():
            self._pending.done.set_exception(self.lost)
        self._task.cancel()
        self._writer.close()
        # The peer may already be gone: that is no news while closing.
        with suppress(OSError, TimeoutError, asyncio.CancelledError):
            await self._task
        with suppress(OSError, TimeoutError):
            async with asyncio.timeout(1.0):
                await self._writer.wait_closed()
