"""The driver against the mock tracker: beams break, links break, answers stay away."""

import asyncio
import time

import numpy as np
import pytest
from tracker_bench import SCALE, Bench, tracker_in_a_thread, until

from drivers.emscon import EmsconTracker, wire
from drivers.emscon.link import EmsconLink
from drivers.errors import (
    BeamBroken,
    DeviceError,
    LinkLost,
    MeasurementError,
    NotReady,
    ProtocolError,
    Silence,
)


@pytest.mark.parametrize("fraction", [0.0, 0.1, 0.5, 0.95])
async def test_beam_broken_in_a_dwell_gives_no_reading(locked: Bench, fraction: float) -> None:
    locked.server.instrument.measuring.break_next = (fraction, None)
    with pytest.raises(BeamBroken):
        await locked.tracker.measure(4.0)
    assert not (await locked.tracker.state()).locked
    with pytest.raises(BeamBroken):
        await locked.tracker.measure(1.0)


async def test_beam_comes_back_by_itself_and_the_next_dwell_is_good(locked: Bench) -> None:
    locked.server.instrument.measuring.break_next = (0.5, 1.0)
    with pytest.raises(BeamBroken):
        await locked.tracker.measure(4.0)
    async with asyncio.timeout(20.0):
        while not (await locked.tracker.state()).locked:  # noqa: ASYNC110
            await asyncio.sleep(0.005)
    reading = await locked.tracker.measure(1.0)
    assert np.linalg.norm(np.array(reading.xyz) - locked.nest("3")) < 0.05


async def test_beam_broken_in_the_stream(locked: Bench) -> None:
    async def watch() -> None:
        count = 0
        async for _ in locked.tracker.stream(0.05):
            count += 1
            if count == 20:
                locked.server.instrument.break_beam()

    with pytest.raises(BeamBroken):
        await watch()
    locked.server.instrument.restore_beam()
    await locked.tracker.measure(0.5)


async def test_beam_loss_between_measurements_is_an_alarm(locked: Bench) -> None:
    locked.server.instrument.break_beam()
    await until(lambda: any("beam is broken" in alarm.what for alarm in locked.alarms))
    locked.tracker.check()


@pytest.mark.parametrize(
    ("fault", "error"),
    [("tracker-cold", NotReady), ("tracker-unstable", NotReady),
     ("tracker-not-initialised", NotReady), ("tracker-result-unstable", MeasurementError)],
)  # fmt: skip
async def test_tracker_that_is_not_fit_to_measure(
    locked: Bench, fault: str, error: type[DeviceError]
) -> None:
    locked.world.faults.inject(fault)
    with pytest.raises(error):
        await locked.tracker.measure(0.5)
    locked.world.faults.clear_all()
    await locked.tracker.initialize()
    await locked.tracker.point_at(locked.nest("3"))
    await locked.tracker.measure(0.5)


async def test_result_that_never_comes(locked: Bench) -> None:
    locked.world.faults.inject("tracker-no-result")
    with pytest.raises(BeamBroken, match="did not come"):
        await locked.tracker.measure(1.0)
    locked.world.faults.clear_all()
    await locked.tracker.measure(1.0)


async def test_unsolicited_error_is_no_answer_to_a_command(locked: Bench) -> None:
    """An AT401 says one after Initialize; it must not fail what happens to be pending."""
    for _ in range(5):
        locked.world.faults.inject("tracker-unsolicited-error")
        assert (await locked.tracker.state()).initialized
    assert any("unasked" in alarm.what for alarm in locked.alarms)


async def test_unsolicited_error_in_a_dwell_is_loss_of_lock(locked: Bench) -> None:
    dwell = await locked.in_dwell()
    locked.server.instrument.unsolicited(12345)
    with pytest.raises(BeamBroken, match="not published"):
        await dwell
    await locked.tracker.measure(0.5)


async def test_smr_carried_away_in_a_dwell(locked: Bench) -> None:
    dwell = await locked.in_dwell()
    locked.server.instrument.drop_smr()
    with pytest.raises(BeamBroken):
        await dwell


async def test_platform_moving_in_a_dwell_is_no_stationary_result(locked: Bench) -> None:
    locked.world.legs[0].command(8.0, 30.0)
    with pytest.raises(MeasurementError, match="did not stand still"):
        await locked.tracker.measure(20.0)


async def test_stop_ends_a_dwell_at_once(locked: Bench) -> None:
    dwell = await locked.in_dwell()
    await locked.tracker.stop()
    await locked.tracker.stop()
    with pytest.raises(BeamBroken, match="stopped"):
        await asyncio.wait_for(dwell, 20.0)
    await locked.tracker.measure(0.5)


async def test_cancelled_dwell_leaves_no_result_behind(locked: Bench) -> None:
    dwell = await locked.in_dwell()
    dwell.cancel()
    with pytest.raises(asyncio.CancelledError):
        await dwell
    await locked.tracker.point_at(locked.nest("4"))
    reading = await locked.tracker.measure(2.0)
    assert np.linalg.norm(np.array(reading.xyz) - locked.nest("4")) < 0.05


async def test_cancelled_command_does_not_answer_the_next_one(locked: Bench) -> None:
    x, y, z = locked.nest("3")
    nowhere = asyncio.create_task(locked.tracker.point_at((x, y, z + 200.0)))
    await asyncio.sleep(0)  # the request is on its way
    nowhere.cancel()
    with pytest.raises(asyncio.CancelledError):
        await nowhere
    await locked.tracker.point_at(locked.nest("4"))
    reading = await locked.tracker.measure(0.5)
    assert np.linalg.norm(np.array(reading.xyz) - locked.nest("4")) < 0.05


@pytest.mark.parametrize("just", ["before it is read", "before it is taken"])
async def test_a_command_cancelled_as_its_answer_comes_is_owed_nothing(
    bench: Bench, just: str
) -> None:
    """The answer is swallowed with the command: the next one of its kind has one of its own."""
    link, loop = bench.tracker._link, asyncio.get_running_loop()
    asking = asyncio.create_task(link.ask("GetFace", 1.0))

    def cancel(packet: wire.Packet) -> None:
        if just == "before it is read":
            asking.cancel()
        else:
            loop.call_soon(asking.cancel)

    link.listen(cancel, lambda error: None)
    with pytest.raises(asyncio.CancelledError):
        await asking
    link.listen(lambda packet: None, lambda error: None)
    assert (await link.ask("GetFace", 1.0)).integer("face") in (0, 1)


async def test_an_answer_that_lies_unread_because_we_were_held_up_counts() -> None:
    with tracker_in_a_thread() as address:
        host, _, port = address.rpartition(":")
        link = await EmsconLink.open(host, int(port))
        asking = asyncio.create_task(link.ask("GetFace", 0.1))
        await asyncio.sleep(0.0)  # the request is on its way
        time.sleep(0.5)  # noqa: ASYNC251 - nothing of this process runs meanwhile
        assert (await asking).integer("face") in (0, 1)
        await link.close()


async def test_stop_while_the_beam_turns_does_not_wait_for_it(locked: Bench) -> None:
    turning = asyncio.create_task(locked.tracker.point_at(locked.nest("b3")))
    await asyncio.sleep(0)
    await locked.tracker.stop()
    assert not turning.done()
    await turning


async def test_link_reset_in_a_dwell(locked: Bench) -> None:
    dwell = await locked.in_dwell()
    locked.server.reset_connection()
    with pytest.raises(LinkLost, match="reconnect"):
        await asyncio.wait_for(dwell, 20.0)
    with pytest.raises(LinkLost):
        locked.tracker.check()
    assert any(alarm.fault for alarm in locked.alarms)


async def test_tracker_that_falls_silent(locked: Bench) -> None:
    locked.world.faults.inject("tracker-silent")
    with pytest.raises(Silence, match="no answer to"):
        await locked.tracker.state()
    with pytest.raises(Silence):
        locked.tracker.check()


class Proxy:
    """Sits between driver and tracker and cuts the tracker's bytes anew."""

    def __init__(self, address: str, sizes: list[int], stop_after: int | None = None) -> None:
        self._host, _, port = address.rpartition(":")
        self._port = int(port)
        self._sizes = sizes
        self._left = stop_after
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._writers: list[asyncio.StreamWriter] = []

    async def start(self) -> str:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return f"127.0.0.1:{self._server.sockets[0].getsockname()[1]}"

    async def stop(self) -> None:
        assert self._server is not None
        self._server.close()
        for task in self._tasks:
            task.cancel()
        for writer in self._writers:
            writer.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        inner_reader, inner_writer = await asyncio.open_connection(self._host, self._port)
        self._writers += [writer, inner_writer]

        async def up() -> None:
            while chunk := await reader.read(4096):
                for byte in chunk:  # commands arrive byte by byte
                    inner_writer.write(bytes([byte]))
                    await inner_writer.drain()
            inner_writer.close()

        task = asyncio.create_task(up())
        self._tasks.add(task)
        turn = 0
        while chunk := await inner_reader.read(self._sizes[turn % len(self._sizes)]):
            turn += 1
            if self._left is not None:
                chunk = chunk[: self._left]
                self._left -= len(chunk)
            writer.write(chunk)
            await writer.drain()
            if self._left == 0:
                break
        writer.close()
        inner_writer.close()


@pytest.mark.parametrize("sizes", [[1], [3, 5, 7], [11, 1, 200], [13]])
async def test_driver_does_not_mind_how_tcp_cuts(bench: Bench, sizes: list[int]) -> None:
    await bench.tracker.close()
    proxy = Proxy(bench.server.address, sizes)
    tracker = await EmsconTracker.connect(await proxy.start(), time_scale=SCALE)
    try:
        await tracker.initialize()
        await tracker.point_at(bench.nest("5"))
        reading = await tracker.measure(0.5)
        assert np.linalg.norm(np.array(reading.xyz) - bench.nest("5")) < 0.05
    finally:
        await tracker.close()
        await proxy.stop()


@pytest.mark.parametrize("length", [3, 9, 100, 171, 200, 330])
async def test_stream_that_ends_in_the_middle(bench: Bench, length: int) -> None:
    await bench.tracker.close()
    proxy = Proxy(bench.server.address, [64], stop_after=length)
    address = await proxy.start()

    async def use() -> None:
        tracker = await EmsconTracker.connect(address, time_scale=SCALE)
        try:
            await tracker.initialize()
        finally:
            await tracker.close()

    with pytest.raises(LinkLost):
        await use()
    await proxy.stop()


async def test_server_that_speaks_something_else() -> None:
    async def http(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(http, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    with pytest.raises(ProtocolError, match="claims to be"):
        await EmsconTracker.connect(f"127.0.0.1:{port}")
    server.close()


async def test_nonsense_from_a_client_does_not_end_the_mock(bench: Bench) -> None:
    await bench.tracker.close()
    rng = np.random.default_rng(8)
    host, _, port = bench.server.address.rpartition(":")
    for _ in range(10):
        reader, writer = await asyncio.open_connection(host, int(port))
        noise = rng.integers(0, 256, 64, dtype=np.uint8).tobytes()
        writer.write(wire.request("GetFace")[:-2] + noise)
        await asyncio.wait_for(reader.read(1000), 20.0)
        writer.close()
    tracker = await EmsconTracker.connect(bench.server.address, time_scale=SCALE)
    await tracker.close()
