"""Everything that goes wrong between PC, bus and drives ends at rest and in words."""

import asyncio
import shutil
import socket
import threading
import time

import can
import pytest
from canopen_bench import FAST_MM_PER_S, set_speed, until

from drivers.canopen import CanopenController
from drivers.canopen.eds import drive_eds_path
from drivers.errors import (
    ConnectFailed,
    DeviceError,
    DeviceFault,
    DriveFault,
    HeartbeatLost,
    LinkLost,
    Refused,
)

HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)
LOW = (0.0, 0.0, 206.0, 0.0, 0.0, 0.0)
HIGH = (0.0, 0.0, 246.0, 0.0, 0.0, 0.0)


async def go(controller: CanopenController, pose: tuple[float, ...]) -> None:
    await controller.move_to_pose(pose)
    await controller.wait_arrived(20.0)


async def test_drive_fault_in_a_move_stops_all_legs(station, connected, slow):
    await slow.move_to_pose(HIGH)
    station.hands("fault", name="drive-fault:4")
    with pytest.raises(DriveFault, match=r"q4 .*hardware error"):
        await slow.wait_arrived(20.0)
    await until(lambda: not station.moving)
    assert any(a.fault and "0x5000" in a.what for a in connected.alarms)
    with pytest.raises(DriveFault):
        await slow.move_to_pose(HOME)


async def test_drive_stays_in_fault_until_the_cause_is_gone(station, enabled):
    station.hands("fault", name="drive-fault:2")
    await until(lambda: enabled._bus.link.faults)
    with pytest.raises(DriveFault, match="q2"):
        await enabled.clear_faults()
    station.hands("clear")
    await enabled.clear_faults()
    enabled.check()
    with pytest.raises(Refused, match="not enabled"):
        await enabled.move_to_pose(HOME)
    await enabled.enable()
    await go(enabled, HOME)


async def test_jammed_leg_becomes_a_following_error(station, connected, slow):
    await slow.move_to_pose(HIGH)
    station.hands("stall", leg=6)
    with pytest.raises(DriveFault, match=r"q6 .*following error.*0x8611"):
        await slow.wait_arrived(20.0)
    await until(lambda: not station.moving)
    station.hands("unstall", leg=6)
    await slow.clear_faults()
    await slow.enable()
    await set_speed(slow, FAST_MM_PER_S)
    await go(slow, HOME)


@pytest.mark.parametrize("node", [3, 10])
async def test_lost_heartbeat_stops_the_machine(station, connected, slow, node: int):
    await slow.move_to_pose(HIGH)
    station.hands("fault", name=f"heartbeat-silent:{node}")
    with pytest.raises(HeartbeatLost, match=f"node {node}"):
        await slow.wait_arrived(20.0)
    await until(lambda: not station.moving)
    with pytest.raises(HeartbeatLost):
        slow.check()
    assert next(a.device for a in connected.alarms if a.fault).endswith(f"(node {node})")
    station.hands("clear")
    await slow.clear_faults()
    await slow.enable()


# python-can lets the error end its receiving thread, where it counts as unhandled.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
async def test_reset_connection_is_a_lost_link_and_the_machine_stops(station, slow):
    await slow.move_to_pose(HIGH)
    station.hands("reset-tcp", of="controller")
    with pytest.raises(LinkLost, match="connect again"):
        await slow.wait_arrived(20.0)
    with pytest.raises(LinkLost, match="emergency stop"):
        await slow.stop()
    await slow.stop()
    with pytest.raises(LinkLost):
        await slow.read_parameters()
    await until(lambda: not station.moving)

    again = await CanopenController.connect("slcan", station.channel)
    with pytest.raises(DriveFault, match="no longer hears the PC"):
        again.check()
    await again.clear_faults()
    await again.enable()
    await set_speed(again, FAST_MM_PER_S)
    await go(again, HOME)
    await again.close()


async def test_machine_stops_when_the_pc_says_nothing_more(station, connected, slow):
    await slow.move_to_pose(HIGH)
    assert station.moving
    slow._bus.link._end.set()  # our heartbeat ends, as if this process hung
    await until(lambda: not station.moving, 6.0)
    await until(lambda: any("no longer hears" in a.what for a in connected.alarms))


async def test_switching_off_and_on_is_noticed(station, connected, enabled):
    station.power_cycle()
    await until(lambda: len(enabled._bus.link.faults) == 7)
    with pytest.raises(DeviceFault, match="switched off and on"):
        enabled.check()
    await enabled.clear_faults()
    await enabled.enable()
    await go(enabled, HOME)


async def test_quick_stop_in_the_middle_of_everything(station, slow):

    async def work() -> None:
        await slow.move_to_pose(HIGH)
        await slow.wait_arrived(20.0)

    working = [asyncio.ensure_future(work()), asyncio.ensure_future(slow.state())]
    await until(lambda: station.moving)
    await slow.stop()
    assert not station.moving
    with pytest.raises(DeviceFault):
        await working[0]
    await working[1]


async def test_a_stop_from_another_thread_needs_no_event_loop(station, slow):
    await slow.move_to_pose(HIGH)
    await until(lambda: station.moving)
    threading.Thread(target=slow.stop_at_once).start()
    deadline = time.monotonic() + 20.0
    while station.moving:  # the event loop does not come to its turn meanwhile
        assert time.monotonic() < deadline
        time.sleep(0.005)  # noqa: ASYNC251
    with pytest.raises(DeviceFault, match="stopped before it reached"):
        await slow.wait_arrived(20.0)
    await slow.stop()
    await slow.close()
    slow.stop_at_once()  # nothing is there any more, and nothing is raised


async def test_jammed_leg_ends_a_jog(station, enabled):
    await go(enabled, LOW)
    station.hands("stall", leg=2)
    with pytest.raises(DriveFault, match=r"q2 .*0x8611"):
        await enabled.jog("q2", 240.0)


async def test_stop_ends_a_jog(station, enabled):
    await go(enabled, LOW)
    drive = enabled._bus.controller.link._network[5]
    await asyncio.to_thread(drive.sdo.download, 0x6081, 0, (10_000).to_bytes(4, "little"))
    jogging = asyncio.ensure_future(enabled.jog("q5", 240.0))
    await until(lambda: station.moving)
    await enabled.stop()
    with pytest.raises(Refused, match="stopped"):
        await jogging
    assert not station.moving


async def test_nobody_at_the_address():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(ConnectFailed, match="Check address"):
        await CanopenController.connect("slcan", f"socket://127.0.0.1:{port}")


async def test_adapter_without_a_controller(station):
    with pytest.raises(ConnectFailed, match="node 42"):
        await CanopenController.connect("slcan", station.channel, node_id=42)


async def test_drives_are_looked_for_at_their_own_nodes_with_their_own_eds(
    station, tmp_path
) -> None:
    own = tmp_path / "own.eds"
    shutil.copy(drive_eds_path("hexapod"), own)
    turned = [6, 5, 4, 3, 2, 1]
    controller = await CanopenController.connect(
        "slcan", station.channel, drive_nodes=turned, drive_eds=[own]
    )
    try:
        assert [drive.remote.id for drive in controller._drives] == turned
        assert [drive.name for drive in controller._drives] == [f"q{n}" for n in range(1, 7)]
    finally:
        await controller.close()
    with pytest.raises(ConnectFailed, match="node 77"):
        await CanopenController.connect("slcan", station.channel, drive_nodes=[1, 2, 3, 4, 5, 77])
    with pytest.raises(DeviceError, match="cannot be read as an EDS file"):
        await CanopenController.connect(
            "slcan", station.channel, drive_eds=[tmp_path / "missing.eds"]
        )


async def test_drive_that_is_switched_off(station):
    station.hands("fault", name="heartbeat-silent:5")
    with pytest.raises(ConnectFailed, match="q5"):
        await CanopenController.connect("slcan", station.channel)


async def test_another_serial_number(station):
    with pytest.raises(Refused, match=r"serial number \d+, expected 77"):
        await CanopenController.connect("slcan", station.channel, serial="77")


async def test_controller_with_wider_limits_than_the_machine_file(station):
    with pytest.raises(Refused, match="lets q2 go from 195 to 265"):
        await CanopenController.connect("slcan", station.channel, limits={"q2": (200.0, 260.0)})


async def test_closing_takes_the_power_off_without_a_fault(station, controller):
    await controller.enable()
    await controller.close()
    await controller.close()
    await asyncio.sleep(1.2)
    again = await CanopenController.connect("slcan", station.channel)
    again.check()
    assert {a.state for a in (await again.state()).actuators} == {"switch on disabled"}
    await again.close()


async def test_a_second_listener_disturbs_nothing(station, enabled):
    with can.Bus(
        interface="slcan", channel=station.channel, sleep_after_open=0, listen_only=True
    ) as listener:
        assert await asyncio.to_thread(listener.recv, 2.0) is not None
        await go(enabled, LOW)
        missing = {0x18A, 0x28A, 0x20A, 0x70A, 0x701}
        while missing:
            message = await asyncio.to_thread(listener.recv, 10.0)
            assert message is not None, missing
            missing.discard(message.arbitration_id)
