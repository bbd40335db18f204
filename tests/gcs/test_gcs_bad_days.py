"""Everything that goes wrong between PC and controller ends at rest and in words."""

import asyncio
import contextlib
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest
import serial
from gcs_bench import HOME, LOW, Bench, until

from drivers.errors import (
    ConnectFailed,
    DeviceError,
    DeviceFault,
    DriveFault,
    HeartbeatLost,
    LinkLost,
    ProtocolError,
    Refused,
    Silence,
)
from drivers.gcs import GcsController
from drivers.gcs.layout import read_layout
from drivers.gcs.line import Line


async def go(controller: GcsController, pose: tuple[float, ...]) -> None:
    await controller.move_to_pose(pose)
    await controller.wait_arrived(20.0)


async def fault_of(controller: GcsController, timeout: float = 20.0) -> DeviceError:
    """Wait until a fault stands, and return it."""
    deadline = time.monotonic() + timeout
    while True:
        try:
            controller.check()
        except DeviceError as error:
            return error
        assert time.monotonic() < deadline
        await asyncio.sleep(0.01)


# ------------------------------------------------------------ drives


async def test_drive_fault_in_a_move_stops_all_sliders(bench: Bench, controller: GcsController):
    await bench.slow_move()
    bench.world.faults.inject("drive-fault:2")
    with pytest.raises(DriveFault, match=r"q2 \(axis B\)"):
        await controller.wait_arrived(20.0)
    await until(lambda: not bench.world.moving)
    await until(lambda: any(a.fault and "q2" in a.device for a in bench.alarms))
    with pytest.raises(DriveFault):
        await controller.move_to_pose(HOME)
    assert [bool(a.fault) for a in (await controller.state()).actuators] == [False, True, False]


async def test_drive_stays_in_fault_until_the_cause_is_gone(
    bench: Bench, controller: GcsController
):
    bench.world.faults.inject("drive-fault:3")
    await fault_of(controller)
    with pytest.raises(DriveFault, match="q3"):
        await controller.clear_faults()
    with pytest.raises(DriveFault, match="q3"):
        await controller.enable()
    bench.world.faults.clear("drive-fault:3")
    await controller.clear_faults()
    controller.check()
    with pytest.raises(Refused, match="not enabled"):
        await controller.move_to_pose(HOME)
    await controller.enable()
    await go(controller, LOW)


async def test_refused_move_says_why_the_servos_are_off(bench: Bench, controller: GcsController):
    await controller.enable()
    bench.world.faults.inject("drive-fault:2")
    await until(lambda: bench.station.controller.sliders["B"].fault)
    with pytest.raises(DriveFault, match="q2"):
        await controller.move_to_pose(LOW)


async def test_jammed_slider_becomes_a_following_error(bench: Bench, controller: GcsController):
    await bench.slow_move()
    bench.world.legs[0].stalled = True
    with pytest.raises(DriveFault, match=r"q1 .*following error"):
        await controller.wait_arrived(20.0)
    await until(lambda: not bench.world.moving)
    bench.world.legs[0].stalled = False
    await controller.clear_faults()
    await controller.enable()
    await controller._link.call(lambda line: line.command("VEL A 20 B 20 C 20"))
    await go(controller, HOME)


async def test_fault_that_stands_at_connect_is_known_at_once(
    bench: Bench, controller: GcsController
):
    bench.world.faults.inject("drive-fault:1")
    await fault_of(controller)
    await controller.close()
    again = await bench.connect()
    with pytest.raises(DriveFault, match="q1"):
        again.check()


# ------------------------------------------------------------ the controller


@pytest.mark.long
async def test_silent_controller_is_noticed_and_has_stopped(
    bench: Bench, controller: GcsController
):
    await bench.slow_move()
    bench.world.faults.inject("controller-silent")
    with pytest.raises((Silence, HeartbeatLost)):
        await controller.wait_arrived(10.0)
    assert isinstance(await fault_of(controller), HeartbeatLost)
    # Nothing gets through: its own watchdog has to stop it.
    await until(lambda: not bench.world.moving)
    with pytest.raises(Silence, match="not confirmed"):
        await controller.stop()
    await controller.stop()
    bench.world.faults.clear("controller-silent")
    await controller.clear_faults()
    controller.check()
    await controller.enable()
    await controller._link.call(lambda line: line.command("VEL A 20 B 20 C 20"))
    await go(controller, HOME)


@pytest.mark.long
async def test_garbage_is_named(bench: Bench, controller: GcsController):
    bench.world.faults.inject("controller-garbage")
    with pytest.raises((ProtocolError, Silence)):
        await controller.channels()
    await fault_of(controller)
    bench.world.faults.clear("controller-garbage")
    await controller.clear_faults()
    assert (await controller.channels())["payload_kg"] == 1.5


async def test_torn_answer_to_a_question_is_asked_again(bench: Bench, controller: GcsController):
    for _ in range(3):
        bench.world.faults.inject("controller-half-line")
        assert (await controller.channels())["payload_kg"] == 1.5
    controller.check()


async def test_power_cycle_is_a_fault_that_stands(bench: Bench, controller: GcsController):
    await controller.write_parameters({"limb1.l0": 411.0})
    await controller.enable()
    bench.world.faults.inject("power-cycle")
    assert "switched off and on" in str(await fault_of(controller))
    with pytest.raises(DeviceFault):
        await controller.move_to_pose(LOW)
    await controller.clear_faults()
    assert (await controller.read_parameters())["limb1.l0"] == 410.0
    await controller.enable()
    await go(controller, LOW)


async def test_machine_stops_when_the_pc_is_gone(bench: Bench, controller: GcsController):
    await controller.close()
    controller = await bench.connect(silence_s=0.5)
    await bench.slow_move()
    held = asyncio.create_task(controller._link.call(lambda line: time.sleep(1.5)))
    await until(lambda: not bench.world.moving)
    assert not any(s.servo for s in bench.station.controller.sliders.values())
    await held


async def test_a_stop_from_another_thread_needs_no_event_loop(
    bench: Bench, controller: GcsController
):
    await bench.slow_move()
    threading.Thread(target=controller.stop_at_once).start()
    deadline = time.monotonic() + 20.0
    while bench.world.moving:  # the event loop does not come to its turn meanwhile
        assert time.monotonic() < deadline
        time.sleep(0.005)  # noqa: ASYNC251
    with pytest.raises(DeviceFault, match="stopped"):
        await controller.wait_arrived(20.0)
    await controller.close()
    controller.stop_at_once()  # nothing is there any more, and nothing is raised


async def test_closing_lets_go_of_the_machine(bench: Bench, controller: GcsController):
    await bench.slow_move()
    await controller.close()
    await controller.close()
    await until(lambda: not bench.world.moving)
    assert not any(s.servo for s in bench.station.controller.sliders.values())
    assert bench.station.controller.watchdog_ms == 0
    with pytest.raises(LinkLost, match="closed"):
        await controller.state()


# ------------------------------------------------------------ the line


@pytest.mark.parametrize("reset", [False, True])
async def test_cut_connection(bench: Bench, controller: GcsController, reset: bool):
    if not bench.port.startswith("socket"):
        pytest.skip("a serial line has no connection")
    await bench.slow_move()
    bench.station.cut(reset)
    with pytest.raises(LinkLost):
        await controller.wait_arrived(20.0)
    assert isinstance(await fault_of(controller), LinkLost)
    with pytest.raises(LinkLost, match="not confirmed"):
        await controller.stop()
    with pytest.raises(LinkLost):
        await controller.clear_faults()
    await until(lambda: not bench.world.moving)


async def test_serial_line_that_is_pulled_out(bench: Bench, controller: GcsController):
    if bench.port.startswith("socket"):
        pytest.skip("TCP")
    bench.station.stop()
    assert isinstance(await fault_of(controller), LinkLost)


async def test_nobody_at_the_address():
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as server:
        port = server.getsockname()[1]
    with pytest.raises(ConnectFailed, match=r"Check the port"):
        await GcsController.connect(f"socket://127.0.0.1:{port}")


async def test_no_such_port():
    with pytest.raises(ConnectFailed, match="Check the port"):
        await GcsController.connect("COM99" if sys.platform == "win32" else "/dev/ttyNone9")


async def test_another_serial_number(bench: Bench, controller: GcsController):
    await controller.close()
    with pytest.raises(Refused, match="serial number 77, expected 78"):
        await GcsController.connect(bench.port, serial="78")


async def test_wider_limits_than_the_machine_allows(bench: Bench, controller: GcsController):
    await controller.close()
    with pytest.raises(Refused, match="axis B go from 280 to 430"):
        await GcsController.connect(bench.port, limits={"q2": (300.0, 430.0)})


async def test_cancelled_caller_disturbs_nobody(controller: GcsController):
    for pause in (0.0, 0.001, 0.003, 0.01):
        asked = asyncio.create_task(controller.state())
        await asyncio.sleep(pause)
        asked.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asked
        assert (await controller.channels())["payload_kg"] == 1.5
    controller.check()


# ------------------------------------------------------------ devices that are none

Rogue = Callable[[bytes], bytes | None]


@contextlib.contextmanager
def rogue(reply: Rogue) -> Iterator[str]:
    """A server that answers every piece of data with ``reply``; None hangs up."""
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as server:

        def serve() -> None:
            with contextlib.suppress(OSError):
                client, _ = server.accept()
                with client:
                    client.settimeout(10.0)
                    while data := client.recv(4096):
                        answer = reply(data)
                        if answer is None:
                            return
                        client.sendall(answer)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield f"socket://127.0.0.1:{server.getsockname()[1]}"
        thread.join(5.0)


@pytest.mark.parametrize(
    ("reply", "error"),
    [
        (lambda data: b"", ConnectFailed),
        (lambda data: data, ConnectFailed),
        (lambda data: b"\xff\x00\x18 \n" * 7, ConnectFailed),
        (lambda data: b"x" * (1 << 17), ProtocolError),
        (lambda data: None, LinkLost),
        (lambda data: b"Me, X, 1, 1\n" if b"IDN" in data else b"no help\n0\n", ProtocolError),
        (lambda data: b"Me, X, 1, 1\n" if b"IDN" in data else b"2\n", Refused),
        (lambda data: b"Me, X, 1, 1\n" if b"IDN" in data else b"0x1=\t0\t1\n0\n", ProtocolError),
    ],
)
async def test_strangers_are_not_taken_for_a_controller(reply: Rogue, error: type[DeviceError]):
    with rogue(reply) as port, pytest.raises(error):
        await asyncio.wait_for(GcsController.connect(port), 30.0)


@pytest.mark.parametrize("sent", ["9" * 5000, "-" + "1" * 4400])
def test_numbers_without_end_are_named(sent: str):
    """Python takes no decimal of more than 4,300 digits."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection, connection.makefile("rb") as lines:
                for line in lines:
                    known = line.endswith(b"*IDN?\n")
                    connection.sendall(b"maker,type,1,1.0\n" if known else sent.encode() + b"\n")

        threading.Thread(target=serve, daemon=True).start()
        port = serial.serial_for_url(f"socket://127.0.0.1:{listener.getsockname()[1]}", timeout=0.2)
        line = Line(port, "controller")
        for ask in (lambda: line.command("SVO 1 1"), lambda: line.query("POS? 1")):
            with pytest.raises(ProtocolError):
                ask()
        port.close()
    entry = f"0x7F010001=\t0\t{sent.strip('-')}\tlimb\tL0\tL0"
    with pytest.raises(ProtocolError):
        read_layout([entry], "controller")
