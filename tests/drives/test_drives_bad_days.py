"""What real drives do, and what goes wrong with them: everything ends at rest and in words."""

import asyncio
import gc
import json
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from bare_lab import FAR, HOME, SHORT

from drivers.errors import DeviceError, DeviceFault, DriveFault, HeartbeatLost, Refused
from mocks.canopen.bare_drive import LATE_MODE_S, LATE_RESET_S
from mocks.canopen.state402 import State


async def until(true: Callable[[], bool], timeout: float = 20.0) -> None:
    async with asyncio.timeout(timeout):
        while not true():  # noqa: ASYNC110 - a plain value, not an event
            await asyncio.sleep(0.005)


async def test_a_mode_that_comes_late_is_waited_for(bare):
    motors = await bare.connect()
    begin = time.monotonic()
    await motors._bus.drives[0].set_mode(6)
    assert time.monotonic() - begin > 0.8 * LATE_MODE_S
    assert bare.drive(1).mode == 6


async def test_a_fault_that_is_reset_late_is_waited_for(bare):
    motors = await bare.ready()
    bare.world.faults.inject("drive-fault:2")
    await until(lambda: bool(motors._bus.link.faults))
    with pytest.raises(DriveFault, match="q2"):
        await motors.clear_faults()
    bare.world.faults.clear_all()
    begin = time.monotonic()
    await motors.clear_faults()
    assert time.monotonic() - begin > 0.8 * LATE_RESET_S
    await motors.enable()
    assert (await motors.state()).enabled


@pytest.mark.long
async def test_a_homing_does_not_end_by_the_bits_of_the_one_before(bare):
    motors = await bare.ready()
    await motors.move_actuators(FAR)
    await motors.wait_arrived(20.0)
    homing = asyncio.ensure_future(motors.home("q1"))
    await until(lambda: bare.drive(1).leg.moving)
    assert not homing.done()
    await homing
    assert bare.world.legs[0].position() == pytest.approx(0.0, abs=1e-4)


@pytest.mark.long
async def test_a_homing_that_cannot_be_made_is_no_success(bare):
    motors = await bare.ready()
    await motors.move_actuators(FAR)
    await motors.wait_arrived(20.0)
    bare.world.legs[0].stalled = True
    with pytest.raises(DriveFault, match=r"q1 .*following error"):
        await motors.home("q1")
    assert not (await motors.state()).actuators[0].homed


async def test_homing_where_it_stands_already(bare):
    motors = await bare.ready()
    await motors.home("q3")
    assert (await motors.state()).actuators[2].homed


@pytest.mark.long
async def test_a_stop_is_a_whole_frame_of_the_drive_s_own_mapping(bare):
    motors = await bare.ready()
    with can.Bus(interface="slcan", channel=bare.channel, sleep_after_open=0) as listener:
        await motors.move_actuators(FAR)
        await until(lambda: bare.moving)
        await motors.stop()
        frames = []
        while (frame := await asyncio.to_thread(listener.recv, 0.2)) and len(frames) < 500:
            frames.append(frame)
    stops = [f for f in frames if f.arbitration_id == 0x201 and f.data[:2] == b"\x02\x00"]
    assert stops
    assert {frame.dlc for frame in stops} == {7}
    assert not bare.moving
    with pytest.raises(DeviceFault, match="stopped"):
        await motors.wait_arrived(5.0)


async def test_a_frame_that_is_too_short_is_dropped_and_is_no_fault(bare):
    motors = await bare.ready()
    await motors._bus.link.send([(0x203, b"\x02\x00")])
    await until(lambda: any("0x8210" in alarm.what for alarm in bare.alarms))
    motors.check()
    assert (await motors.state()).enabled


async def test_a_stop_from_another_thread_needs_no_event_loop(bare):
    motors = await bare.ready(speed=(4.0,) * 6)
    await motors.move_actuators(FAR)
    await until(lambda: bare.moving)
    threading.Thread(target=motors.stop_at_once).start()
    deadline = time.monotonic() + 20.0
    while bare.moving:  # the event loop does not come to its turn meanwhile
        assert time.monotonic() < deadline
        time.sleep(0.005)  # noqa: ASYNC251
    with pytest.raises(DeviceFault, match="stopped"):
        await motors.wait_arrived(20.0)
    await motors.stop()
    await motors.close()
    motors.stop_at_once()  # nothing is there any more, and nothing is raised


async def test_a_drive_without_a_pdo_for_its_controlword_is_stopped_by_sdo(bare):
    for number in range(1, 7):
        bare.drive(number).keep(0x1400, 1, 0x8000_0200 + number)
    motors = await bare.ready()
    assert motors._bus.drives[0].control_frame(2) is None
    await motors.move_actuators(FAR)
    await until(lambda: bare.moving)
    await motors.stop()
    assert not bare.moving


async def test_a_stop_by_sdo_that_a_lost_drive_does_not_hear_is_told(bare):
    for number in range(1, 7):
        bare.drive(number).keep(0x1400, 1, 0x8000_0200 + number)
    unseen: list[dict] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: unseen.append(context))
    motors = await bare.ready(silence_s=SHORT)
    bare.world.faults.inject("heartbeat-silent:5")
    await until(lambda: any("the stop could not be sent" in a.what for a in bare.alarms))
    with pytest.raises(DeviceError, match="the stop was not confirmed") as told:
        await motors.stop()
    assert "emergency stop" in told.value.remedy
    await motors.stop()  # asked for again it is known
    del motors._bus._halting
    gc.collect()
    assert unseen == []


async def test_nothing_that_was_under_way_undoes_a_stop(bare):
    motors = await bare.ready()
    moving = asyncio.ensure_future(motors.move_actuators(FAR))
    await asyncio.sleep(0.01)
    await motors.stop()
    await asyncio.wait([moving])
    moving.exception()
    await asyncio.sleep(0.3)
    assert not bare.moving
    assert not any(drive.state is State.OPERATION_ENABLED for drive in bare.station.drives)


async def test_one_that_falls_silent_stops_all(bare):
    motors = await bare.ready(speed=(4.0,) * 6, silence_s=SHORT)
    await motors.move_actuators(FAR)
    bare.world.faults.inject("heartbeat-silent:5")
    with pytest.raises(HeartbeatLost, match=r"q5 \(node 5\)"):
        await motors.wait_arrived(20.0)
    # The silent one does not hear the stop either: it stops because it does not hear the PC.
    await until(lambda: not any(leg.moving for n, leg in enumerate(bare.world.legs) if n != 4))


async def test_a_motor_that_runs_the_wrong_way_is_stopped_at_once(bare):
    motors = await bare.ready()
    bare.world.faults.inject("runs-away:1")
    await motors.move_actuators(FAR)
    with pytest.raises(DriveFault, match=r"q1 .*moves away from its target.*0x607E"):
        await motors.wait_arrived(20.0)
    await until(lambda: not bare.moving)
    assert -3.0 < bare.world.legs[0].position() < 0.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("on_silence", "state"),
    [
        (1, State.FAULT),
        (2, State.SWITCH_ON_DISABLED),
        (3, State.SWITCH_ON_DISABLED),
    ],
)
@pytest.mark.parametrize("mode", ["profile", "cyclic"])
async def test_without_the_pc_the_drives_stop_by_themselves(bare, on_silence, state, mode):
    motors = await bare.ready(on_silence=on_silence, speed=(2.0,) * 6, mode=mode, silence_s=SHORT)
    await motors.move_actuators(FAR)
    await until(lambda: bare.moving)
    motors._bus.link._end.set()  # our heartbeat ends, as if this process were dead
    if motors._stream is not None:
        motors._stream._end.set()
    await until(lambda: not bare.moving, 5.0)
    # This process lives, and stops the others as soon as it hears of the first.
    ended = {state, State.SWITCH_ON_DISABLED, State.QUICK_STOP_ACTIVE}
    await until(lambda: {drive.state for drive in bare.station.drives} <= ended, 5.0)
    await until(lambda: state in {drive.state for drive in bare.station.drives}, 5.0)
    assert bare.world.legs[0].position() < 10.0


PROGRAM = """
import asyncio, json, sys
from bare_lab import FAR, motors_of
async def main():
    motors = await motors_of(json.loads(sys.argv[1]))
    await motors.enable()
    await motors.move_actuators(FAR)
    await asyncio.sleep(60.0)
asyncio.run(main())
"""


@pytest.mark.long
@pytest.mark.parametrize("mode", ["profile", "cyclic"])
async def test_a_program_that_is_killed_in_motion_leaves_drives_that_stop(bare, mode):
    for number in range(1, 7):
        bare.drive(number).attain()
    told = bare.stated(speed=[2.0] * 6, mode=mode, silence_s=SHORT)
    words = [sys.executable, "-c", PROGRAM, json.dumps(told)]
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    program = await asyncio.create_subprocess_exec(*words, env={**os.environ, "PYTHONPATH": paths})
    try:
        await until(lambda: bare.world.legs[0].position() > 0.2, 60.0)
    finally:
        program.kill()
        await program.wait()
    where = bare.world.legs[0].position()
    await until(lambda: {drive.state for drive in bare.station.drives} == {State.FAULT})
    await until(lambda: not bare.moving)
    # Nobody else is there to stop them, and the way of the longest was 16 mm.
    assert bare.world.legs[0].position() - where < 12.0


async def test_a_restart_is_a_fault_and_everything_is_set_up_again(bare):
    motors = await bare.ready(quick_stop=6)
    bare.station.power_cycle()
    await until(lambda: len(motors._bus.link.faults) == 6)
    await motors.clear_faults()
    assert bare.drive(1).value(0x605A) == 6
    await motors.enable()
    with pytest.raises(Refused, match="does not know its reference"):
        await motors.move_actuators(HOME)


async def test_a_place_outside_the_limits_names_the_drive(bare):
    motors = await bare.ready()
    with pytest.raises(Refused, match=r"q4 = 265\.5 mm is outside 195 to 265"):
        await motors.move_actuators((*HOME[:3], 265.5, *HOME[4:]))
    assert not bare.moving


async def test_limits_that_the_drive_has_found_narrower_itself(bare):
    motors = await bare.ready()
    bare.drive(1).keep(0x607D, 2, round(5.0 * bare.drive(1).counts))
    await motors.move_actuators(FAR)
    with pytest.raises(Refused, match=r"q1 .*0x607D"):
        await motors.wait_arrived(20.0)


async def test_references_by_another_object_and_by_this_program_alone(bare):
    motors = await bare.ready(referenced="0x2010 bit 0")
    assert all(actuator.homed for actuator in (await motors.state()).actuators)
    await motors.close()
    again = await bare.connect(referenced="homing")
    assert not any(actuator.homed for actuator in (await again.state()).actuators)
