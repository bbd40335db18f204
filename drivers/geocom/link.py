"""GeoCOM on a serial line or TCP: a request, then the answer with its number."""

import asyncio
import contextlib
import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass

import serial

from drivers.errors import ConnectFailed, DeviceError, LinkLost, ProtocolError, Silence
from drivers.geocom.codes import Rpc

CONNECT_S = 5.0
LONGEST_ANSWER = 4096
READ_S = 0.05
REMEDY = "Check the cable, the baud rate and that GeoCOM is on, then connect again."
GARBLED = "Check cable and baud rate: what it sends arrives damaged; then measure again."
_ANSWER = re.compile(r"%R1P,(\d+),(\d+)(?:,\d+)?:(\d+)(?:,(.*))?")


@dataclass(frozen=True)
class Answer:
    """A return code and the values behind it, as text."""

    code: int
    values: tuple[str, ...]

    def numbers(self, count: int, device: str) -> tuple[float, ...]:
        """The first ``count`` values as finite numbers; raises ProtocolError."""
        try:
            found = tuple(float(one) for one in self.values[:count])
        except ValueError:
            found = ()
        if len(found) != count or not all(map(math.isfinite, found)):
            raise ProtocolError(
                f"the answer {','.join(self.values)!r} is no numbers",
                device=device,
                remedy=GARBLED,
            )
        return found


class GeoComLink:
    """One instrument; requests wait for one another."""

    def __init__(self, port: serial.Serial, margin_s: float, device: str) -> None:
        self._port, self._margin_s, self.device = port, margin_s, device
        self._turn = asyncio.Lock()
        self._number = 0
        self._rest = b""
        self._lost: DeviceError | None = None
        self.on_lost: Callable[[DeviceError], None] = lambda error: None

    @classmethod
    async def open(cls, url: str, baud: int, margin_s: float) -> "GeoComLink":
        """Open a port and ask for a sign of life; raises ConnectFailed, Silence."""
        device = f"total station {url}"

        def port() -> serial.Serial:
            opened: serial.Serial = serial.serial_for_url(
                url, baud, timeout=READ_S, write_timeout=CONNECT_S
            )
            return opened

        try:
            async with asyncio.timeout(CONNECT_S):
                opened = await asyncio.to_thread(port)
        except (OSError, ValueError, TimeoutError) as error:
            said = getattr(error, "strerror", None) or str(error) or "no answer"
            raise ConnectFailed(
                f"the port cannot be opened ({said})", device=device, remedy=REMEDY
            ) from error
        link = cls(opened, margin_s, device)
        try:
            await link.request(Rpc.COM_NULLPROC)
        except DeviceError:
            await link.close()
            raise
        return link

    def check(self) -> None:
        """Raise what ended the link, if anything did."""
        if self._lost is not None:
            raise self._lost

    async def request(self, rpc: Rpc, *values: float | str, wait_s: float = 0.0) -> Answer:
        """Ask, and wait for the answer: the margin of the link and ``wait_s`` of wall time.

        Raises
        ------
        Silence
            If none comes; the link is then lost.
        LinkLost
        ProtocolError
            For an answer that is none, or that says that the request was not understood.
        """
        async with self._turn:
            self.check()
            self._number = self._number % 999_999 + 1
            text = f"\n%R1Q,{rpc.value},{self._number}:{','.join(map(_written, values))}\r\n"
            try:
                return await asyncio.to_thread(
                    self._exchange, text, rpc, time.monotonic() + self._margin_s + wait_s
                )
            except (OSError, TypeError) as error:  # TypeError: what a closed port raises
                self.fail(LinkLost(str(error) or "closed", device=self.device, remedy=REMEDY))
            except Silence as error:
                self.fail(error)
            self.check()
            raise AssertionError  # the line before has raised

    def _exchange(self, text: str, rpc: Rpc, until: float) -> Answer:
        self._port.write(text.encode("ascii"))
        while time.monotonic() < until:
            line = self._line()
            if line is None:
                continue
            found = _ANSWER.fullmatch(line)
            if found is None:
                raise ProtocolError(
                    f"the answer to {rpc.name} is {line!r}", device=self.device, remedy=GARBLED
                )
            com, number, code, rest = found.groups()
            if int(number) != self._number:
                continue  # a late answer to a request that was given up
            if int(com):
                raise ProtocolError(
                    f"{rpc.name} was not understood (communication code {com})",
                    device=self.device,
                    remedy="This instrument or its firmware lacks that procedure",
                )
            return Answer(int(code), tuple((rest or "").split(",")) if rest else ())
        raise Silence(f"no answer to {rpc.name}", device=self.device, remedy=REMEDY)

    def _line(self) -> str | None:
        """The next line that is not empty, if one has come."""
        while b"\n" not in self._rest:
            more = self._port.read(max(1, self._port.in_waiting))
            if not more:
                return None
            self._rest += bytes(more)
            if len(self._rest) > LONGEST_ANSWER:
                self._rest = b""
                raise ProtocolError("an answer without an end", device=self.device, remedy=GARBLED)
        line, _, self._rest = self._rest.partition(b"\n")
        return line.decode("latin-1").strip() or None

    def fail(self, error: DeviceError, *, say: bool = True) -> None:
        """Keep what ended the link, and say it once."""
        if self._lost is None:
            self._lost = error
            if say:
                self.on_lost(error)

    async def close(self) -> None:
        """Let go; never raises."""
        closed = "the connection was closed"
        self.fail(LinkLost(closed, device=self.device, remedy="Connect again."), say=False)
        with contextlib.suppress(OSError):
            await asyncio.to_thread(self._port.close)


def _written(value: float | str) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return str(value) if isinstance(value, int) else f"{value:.15g}"
