"""What goes wrong on the way to a closed hexapod, and with it: faults in words, never a hang."""

import asyncio
import threading
import time
from collections.abc import AsyncIterator

import pytest
from gcs_bench import running, tcp_port
from hexapod_bench import HOME, SETTINGS, THERE, HexapodBench, SixLegs, until

from app.files.machines import load_machine
from app.hosted.means import ByPoses
from drivers.errors import (
    ConnectFailed,
    DeviceFault,
    DriveFault,
    HeartbeatLost,
    LinkLost,
    Refused,
    Silence,
)
from drivers.gcs.pose_kind import KIND
from drivers.kind import Surroundings
from mocks.gcs.server import GcsStation


@pytest.fixture
async def bench() -> AsyncIterator[HexapodBench]:
    world = SixLegs()
    with running(GcsStation(world, serial=77, pose=True)) as station:
        made = HexapodBench(world, station, tcp_port(station))
        await until(lambda: not station.controller.busy)
        yield made
        if made.mover is not None:
            await made.mover.close()


async def slow(bench: HexapodBench) -> None:
    """A move that takes several wall seconds is under way."""
    mover = await bench.ready(velocity_mm_s=0.02)
    await mover.move_pose(THERE)
    await until(lambda: bench.world.moving)


async def test_switched_off() -> None:
    settings = {**SETTINGS, "port": "socket://127.0.0.1:9"}
    with pytest.raises(ConnectFailed, match="Check the port"):
        await KIND.open(Surroundings(settings, "", "hexapod", (), {}))


async def test_wrong_baud_rate_is_garbage_and_no_hang(bench: HexapodBench) -> None:
    bench.world.faults.inject("controller-garbage")
    with pytest.raises(ConnectFailed, match="nobody says who it is"):
        await bench.connect()


async def test_a_controller_that_starts_up_is_waited_for(bench: HexapodBench) -> None:
    bench.world.faults.inject("power-cycle")
    await until(lambda: "power-cycle" not in bench.world.faults)
    mover = await bench.connect()
    assert not (await mover.state()).enabled


async def test_a_stop_ends_a_move_and_holds_the_platform(bench: HexapodBench) -> None:
    await slow(bench)
    waiting = asyncio.ensure_future(bench.driver.wait_arrived(20.0))
    await asyncio.sleep(0.05)
    await bench.driver.stop()
    await bench.driver.stop()
    with pytest.raises(DeviceFault, match="stopped before it reached"):
        await waiting
    assert not bench.world.moving
    assert (await bench.driver.state()).enabled
    with pytest.raises(Refused, match="was stopped"):
        await bench.driver.move_pose(HOME)
    await bench.driver.enable()
    await bench.driver.move_pose(HOME)


async def test_a_stop_from_another_thread_needs_no_event_loop(bench: HexapodBench) -> None:
    await slow(bench)
    threading.Thread(target=bench.driver.stop_at_once).start()
    deadline = time.monotonic() + 20.0
    while bench.world.moving:  # the event loop does not come to its turn meanwhile
        assert time.monotonic() < deadline
        time.sleep(0.005)  # noqa: ASYNC251
    with pytest.raises(DeviceFault, match="stopped"):
        await bench.driver.wait_arrived(20.0)
    await bench.driver.close()
    bench.driver.stop_at_once()  # nothing is there any more, and nothing is raised


async def test_somebody_else_stops_it(bench: HexapodBench) -> None:
    await slow(bench)
    bench.obey("STP")
    with pytest.raises(DeviceFault, match="stopped before it reached"):
        await bench.driver.wait_arrived(20.0)


async def test_a_leg_that_stalls_switches_all_off(bench: HexapodBench) -> None:
    await slow(bench)
    bench.world.legs[2].stalled = True
    with pytest.raises(DriveFault, match="switched themselves off"):
        await bench.driver.wait_arrived(20.0)
    assert not bench.world.moving
    bench.world.legs[2].stalled = False
    await bench.driver.clear_faults()
    await bench.driver.enable()
    await bench.driver.move_pose(HOME)
    assert [alarm.fault for alarm in bench.alarms] == [True]


async def test_switched_off_and_on_is_a_fault_and_it_must_be_referenced(
    bench: HexapodBench,
) -> None:
    mover = await bench.ready()
    bench.world.faults.inject("power-cycle")
    await until(lambda: bench.alarms != [])
    with pytest.raises(DeviceFault, match="switched off and on"):
        mover.check()


async def test_reference_lost_is_refused_before_it_moves(bench: HexapodBench) -> None:
    mover = await bench.ready()
    bench.world.faults.inject("reference-lost:4")
    await until(lambda: "reference-lost:4" not in bench.world.faults)
    with pytest.raises(Refused, match="does not know its reference"):
        await mover.move_pose(THERE)
    assert not bench.world.moving


async def test_a_reference_move_that_is_stopped(bench: HexapodBench) -> None:
    mover = await bench.ready(velocity_mm_s=0.5)
    await mover.move_pose(THERE)
    await mover.wait_arrived(20.0)
    homing = asyncio.ensure_future(mover.home("x"))
    await until(lambda: bench.world.moving)
    bench.obey("HLT")
    with pytest.raises(DeviceFault, match="before it found its reference"):
        await homing


@pytest.mark.long
async def test_silence_in_motion_is_a_fault(bench: HexapodBench) -> None:
    await slow(bench)
    bench.world.faults.inject("controller-silent")
    with pytest.raises((Silence, HeartbeatLost)):
        await bench.driver.wait_arrived(20.0)
    await until(lambda: bench.alarms != [])
    with pytest.raises(HeartbeatLost, match="cannot be asked"):
        bench.driver.check()


async def test_a_cut_line_is_lost(bench: HexapodBench) -> None:
    mover = await bench.ready()
    bench.station.cut(reset=True)
    await until(lambda: bench.alarms != [])
    with pytest.raises(LinkLost):
        mover.check()
    with pytest.raises(LinkLost):
        await mover.move_pose(THERE)


async def test_an_answer_that_breaks_off_is_asked_again(bench: HexapodBench) -> None:
    mover = await bench.ready()
    for _ in range(3):
        bench.world.faults.inject("controller-half-line")
        assert (await mover.frame())["system"] == "ZERO"


async def test_servos_stay_on_at_the_end_if_they_shall(bench: HexapodBench) -> None:
    for keep in (True, False):
        mover = await bench.ready(keep_servo=keep)
        await mover.close()
        assert bench.obey("SVO? X") == f"X={int(keep)}\n"


async def test_one_reference_move_is_enough_for_all_axes(bench: HexapodBench) -> None:
    mover = await bench.connect()
    await mover.enable()
    means = ByPoses(mover, load_machine("hexapod"))
    await means.home("q1")
    assert all(axis.homed for axis in (await means.state()).actuators)
    await means.home("q2")  # they have it: nothing moves
    assert not bench.world.moving
