"""Where lines come from: a TCP connection, a serial port, a file that grows.

A source reads for ever and hands on whole lines as they come; what it is asked to send goes out as
it stands. Each ends by :meth:`Source.close`, from whatever it waits for.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Protocol

import serial

from drivers.errors import ConnectFailed, LinkLost, Refused

CONNECT_S = 5.0
LONGEST_LINE = 4096
"""Bytes after which a line without an end is no line."""
LOOK_S = 0.05
"""How often a file is looked at, s of wall time."""
REMEDY = "Check the instrument, its cable and its address, then connect again."


class Source(Protocol):
    """Lines of an instrument."""

    def lines(self) -> AsyncIterator[str]:
        """Lines as they come, without their ends; raises LinkLost where the link ends."""

    async def send(self, text: str) -> None:
        """Send text; raises Refused where there is nobody who could be asked."""

    async def close(self) -> None:
        """Let go; never raises."""


class TcpSource:
    """A connection to ``host:port``."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, device: str
    ) -> None:
        self._reader, self._writer, self._device = reader, writer, device

    @classmethod
    async def open(cls, address: str, device: str) -> "TcpSource":
        """Connect; raises ConnectFailed."""
        host, _, port = address.rpartition(":")
        try:
            async with asyncio.timeout(CONNECT_S):
                reader, writer = await asyncio.open_connection(host, int(port), limit=LONGEST_LINE)
        except (OSError, ValueError, TimeoutError) as error:
            raise ConnectFailed(
                f"nobody answers ({error or 'no answer'})", device=device, remedy=REMEDY
            ) from error
        return cls(reader, writer, device)

    async def lines(self) -> AsyncIterator[str]:
        """See :class:`Source`."""
        while True:
            try:
                line = await self._reader.readline()
            except (OSError, ValueError) as error:  # ValueError: a line without an end
                raise LinkLost(_said(error), device=self._device, remedy=REMEDY) from error
            if not line:
                raise LinkLost(
                    "the instrument closed the connection", device=self._device, remedy=REMEDY
                )
            yield line.decode("latin-1").strip("\r\n")

    async def send(self, text: str) -> None:
        """See :class:`Source`."""
        try:
            self._writer.write(text.encode("latin-1", "replace"))
            async with asyncio.timeout(CONNECT_S):
                await self._writer.drain()
        except (OSError, TimeoutError) as error:
            raise LinkLost(_said(error), device=self._device, remedy=REMEDY) from error

    async def close(self) -> None:
        """See :class:`Source`."""
        with contextlib.suppress(OSError):
            self._writer.close()


class SerialSource:
    """A serial port, eight bits, no parity, one stop bit unless said otherwise."""

    def __init__(self, port: serial.Serial, device: str) -> None:
        self._port, self._device = port, device
        self._closed = False
        self._rest = b""

    @classmethod
    async def open(cls, path: str, baud: int, frame: str, device: str) -> "SerialSource":
        """Open the port; ``frame`` as "8N1"; raises ConnectFailed."""

        def port() -> serial.Serial:
            opened: serial.Serial = serial.serial_for_url(
                path, baud, bytesize=int(frame[0]), parity=frame[1], stopbits=int(frame[2]),
                timeout=LOOK_S, write_timeout=CONNECT_S,
            )  # fmt: skip
            return opened

        try:
            async with asyncio.timeout(CONNECT_S):
                return cls(await asyncio.to_thread(port), device)
        except (OSError, ValueError, TimeoutError) as error:
            raise ConnectFailed(
                f"the port cannot be opened ({_said(error)})", device=device,
                remedy="Check the name of the port, and that no other program holds it",
            ) from error  # fmt: skip

    async def lines(self) -> AsyncIterator[str]:
        """See :class:`Source`."""
        while not self._closed:
            try:
                more = await asyncio.to_thread(self._read)
            except (OSError, TypeError, ValueError) as error:  # what a closed port raises
                raise LinkLost(_said(error), device=self._device, remedy=REMEDY) from error
            self._rest += more
            if len(self._rest) > LONGEST_LINE and not _ended(self._rest):
                raise LinkLost(
                    "a line without an end", device=self._device,
                    remedy="Check the baud rate and the frame of the port",
                )  # fmt: skip
            while at := _ended(self._rest):
                line, self._rest = self._rest[: at - 1], self._rest[at:].lstrip(b"\n")
                yield line.decode("latin-1")
        raise LinkLost("the port was closed", device=self._device, remedy=REMEDY)

    def _read(self) -> bytes:
        return bytes(self._port.read(max(1, self._port.in_waiting)))

    async def send(self, text: str) -> None:
        """See :class:`Source`."""
        try:
            await asyncio.to_thread(self._port.write, text.encode("latin-1", "replace"))
        except OSError as error:
            raise LinkLost(_said(error), device=self._device, remedy=REMEDY) from error

    async def close(self) -> None:
        """See :class:`Source`."""
        self._closed = True
        with contextlib.suppress(OSError):
            await asyncio.to_thread(self._port.close)


class FileSource:
    """A file into which another program writes; what is in it before is not read."""

    def __init__(self, path: Path, begin: int, device: str) -> None:
        self._path, self._at, self._device = path, begin, device
        self._closed = False

    @classmethod
    async def open(cls, path: str, device: str) -> "FileSource":
        """Stand at the end of the file; raises ConnectFailed where there is none."""
        try:
            begin = await asyncio.to_thread(lambda: Path(path).stat().st_size)
        except OSError as error:
            raise ConnectFailed(
                f"the file cannot be read ({error.strerror})", device=device,
                remedy="Start the program that writes it, and check its path",
            ) from error  # fmt: skip
        return cls(Path(path), begin, device)

    async def lines(self) -> AsyncIterator[str]:
        """See :class:`Source`; a file that was begun anew is read from its beginning."""
        while not self._closed:
            try:
                more = await asyncio.to_thread(self._more)
            except OSError as error:
                raise LinkLost(
                    f"the file cannot be read any more ({_said(error)})", device=self._device,
                    remedy=REMEDY,
                ) from error  # fmt: skip
            for line in more:
                yield line
            if not more:
                await asyncio.sleep(LOOK_S)
        raise LinkLost("the file was let go", device=self._device, remedy=REMEDY)

    def _more(self) -> list[str]:
        """Whole lines that have come; a line that is being written waits for its end."""
        if self._path.stat().st_size < self._at:
            self._at = 0
        with self._path.open("rb") as file:
            file.seek(self._at)
            read = file.read(1_000_000)
        whole = read.rpartition(b"\n")[0] + b"\n" if b"\n" in read else b""
        self._at += len(whole)
        return [line.strip("\r") for line in whole.decode("latin-1").split("\n")[:-1]]

    async def send(self, text: str) -> None:
        """See :class:`Source`."""
        raise Refused("a file cannot be asked", device=self._device, remedy="Leave out ask")

    async def close(self) -> None:
        """See :class:`Source`."""
        self._closed = True


def _ended(text: bytes) -> int:
    """Where the first line ends (behind its end); 0 where none does."""
    ends = [at for at in (text.find(b"\n"), text.find(b"\r")) if at >= 0]
    return min(ends) + 1 if ends else 0


def _said(error: BaseException) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
