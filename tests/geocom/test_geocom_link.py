"""Strange answers, late answers, no answers."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

import pytest

from drivers.errors import ConnectFailed, LinkLost, ProtocolError, Refused, Silence
from drivers.geocom.codes import Rpc
from drivers.geocom.link import GeoComLink

Answers = Callable[[str, str], str | None]


@contextlib.asynccontextmanager
async def instrument(answers: Answers) -> AsyncIterator[str]:
    """An instrument whose answer is a function of procedure and number; None: it hangs up."""
    clients: list[asyncio.StreamWriter] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        clients.append(writer)
        with contextlib.suppress(OSError):
            while line := await reader.readline():
                text = line.decode().strip()
                if not text:
                    continue
                procedure, number = text.removeprefix("%R1Q,").split(":")[0].split(",")[:2]
                said = f"%R1P,0,{number}:0" if procedure == "0" else answers(procedure, number)
                if said is None:
                    writer.close()
                    return
                writer.write(f"{said}\r\n".encode() if said else b"")

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield f"socket://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()
        for client in clients:
            client.close()


@pytest.mark.parametrize(
    ("answers", "error"),
    [
        (lambda procedure, number: "?", ProtocolError),
        (lambda procedure, number: f"%R1P,3081,{number}:0", ProtocolError),
        (lambda procedure, number: f"%R1P,0,{int(number) - 1}:0", Silence),
        (lambda procedure, number: "", Silence),
        (lambda procedure, number: "x" * 9000, ProtocolError),
        (lambda procedure, number: None, LinkLost),
    ],
)
async def test_what_is_no_answer_is_named(answers: Answers, error: type[Exception]) -> None:
    async with instrument(answers) as url:
        link = await GeoComLink.open(url, 9600, 0.4)
        with pytest.raises(error):
            await link.request(Rpc.TMC_GET_FACE)
        await link.close()


async def test_a_late_answer_is_passed_by_and_numbers_are_numbers() -> None:
    def late(procedure: str, number: str) -> str:
        return f"%R1P,0,{int(number) - 1}:0,7\r\n%R1P,0,{number}:0,1"

    async with instrument(late) as url:
        link = await GeoComLink.open(url, 9600, 1.0)
        answer = await link.request(Rpc.TMC_GET_FACE)
        assert answer.numbers(1, "") == (1.0,)
        with pytest.raises(ProtocolError):
            answer.numbers(2, "")
        await link.close()
        with pytest.raises(LinkLost):
            await link.request(Rpc.TMC_GET_FACE)


async def test_nobody_there_is_said() -> None:
    for url in ("socket://127.0.0.1:1", "/dev/no-such-port"):
        with pytest.raises(ConnectFailed):
            await GeoComLink.open(url, 9600, 0.3)


async def test_a_prism_that_it_does_not_know_is_refused() -> None:
    from drivers.geocom.kind import KIND
    from drivers.kind import Surroundings

    def plain(procedure: str, number: str) -> str:
        return f"%R1P,0,{number}:{2 if procedure == '17008' else 0},1"

    async with instrument(plain) as url:
        stated = {"port": url, "sigma_arcsec": 1.0, "sigma_distance_mm": 1.0}
        settings = {one.name: stated.get(one.name, one.default) for one in KIND.settings}
        tracker = await KIND.open(Surroundings(settings, "", "hexapod", (), {}, 1.0))
        for name in ("cat's eye", "mini"):
            with pytest.raises(Refused):
                await tracker.select_reflector(name)
        with pytest.raises(Refused):
            await tracker.point_at((0.0, 0.0, 0.0))
        await tracker.close()
