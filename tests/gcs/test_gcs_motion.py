"""Moving the tripod through the wire: where it goes is what its parameters say."""

import asyncio
import math
import time

import pytest
from gcs_bench import HOME, LOW, Bench, until

from drivers.errors import DeviceFault, Refused
from drivers.gcs import GcsController


async def go(controller: GcsController, pose: tuple[float, ...]) -> tuple[float, ...]:
    q = await controller.move_to_pose(pose)
    await controller.wait_arrived(20.0)
    return q


async def test_home_pose_is_slider_place_410(controller: GcsController):
    await controller.enable()
    assert await go(controller, HOME) == pytest.approx((410.0,) * 3, abs=1e-9)


async def test_sliders_stand_where_the_controller_says(bench: Bench, controller: GcsController):
    await controller.enable()
    q = await go(controller, LOW)
    assert [410.0 + leg.position() for leg in bench.world.legs] == pytest.approx(q, abs=1e-9)
    state = await controller.state()
    assert [a.target for a in state.actuators] == list(q)
    assert state.enabled
    assert not state.moving


async def test_written_parameter_changes_the_next_targets(controller: GcsController):
    await controller.enable()
    before = await go(controller, LOW)
    await controller.disable()
    await controller.write_parameters({"limb2.l0": 411.25})
    await controller.enable()
    after = await go(controller, LOW)
    assert [a - b for a, b in zip(after, before, strict=True)] == pytest.approx([0, -1.25, 0])


async def test_jog_moves_one_slider(bench: Bench, controller: GcsController):
    await controller.enable()
    await controller.jog("q3", 400.5)
    assert [leg.position() for leg in bench.world.legs] == pytest.approx([0.0, 0.0, -9.5])


async def test_move_to_q(bench: Bench, controller: GcsController):
    await controller.enable()
    await controller.move_to_q((400.0, 405.0, 410.0))
    await controller.wait_arrived(20.0)
    assert [leg.position() for leg in bench.world.legs] == pytest.approx([-10.0, -5.0, 0.0])


async def test_lost_reference_is_found_again(bench: Bench, controller: GcsController):
    bench.world.faults.inject("reference-lost:2")
    await until(lambda: not bench.station.controller.sliders["B"].referenced)
    await controller.enable()
    assert [a.homed for a in (await controller.state()).actuators] == [True, False, True]
    with pytest.raises(Refused, match="reference"):
        await controller.move_to_pose(LOW)
    await controller.home("q2")
    assert all(a.homed for a in (await controller.state()).actuators)
    await go(controller, LOW)


@pytest.mark.parametrize(
    ("pose", "says"),
    [
        ((0.0, 0.0, -20.0, 0.0, 0.0, 0.0), "limits"),
        ((90.0, 90.0, -240.0, 0.0, 0.0, 0.0), "limits"),
        ((0.0, 0.0, math.nan, 0.0, 0.0, 0.0), "finite"),
        ((0.0, 0.0, -120.0, 0.0, 0.1, 0.0), "cannot turn"),
        ((0.0, 0.0), "finite"),
    ],
)
async def test_impossible_pose_is_refused(bench: Bench, controller: GcsController, pose, says):
    await controller.enable()
    with pytest.raises(Refused, match=says):
        await controller.move_to_pose(pose)
    assert not bench.world.moving


async def test_without_power_nothing_moves(controller: GcsController):
    with pytest.raises(Refused, match="not enabled") as refused:
        await controller.move_to_pose(LOW)
    assert refused.value.code == 5


async def test_stop_during_a_move(bench: Bench, controller: GcsController):
    await bench.slow_move()
    waiting = asyncio.create_task(controller.wait_arrived(20.0))
    await controller.stop()
    assert not bench.world.moving
    with pytest.raises(DeviceFault, match="stopped"):
        await waiting
    await controller.stop()
    with pytest.raises(Refused, match="stopped"):
        await controller.move_to_pose(LOW)
    await controller.enable()
    controller.check()
    await controller._link.call(lambda line: line.command("VEL A 20 B 20 C 20"))
    await go(controller, LOW)


async def test_stop_overtakes_commands_that_wait(bench: Bench, controller: GcsController):
    await controller.enable()
    held = asyncio.create_task(controller._link.call(lambda line: time.sleep(1.0)))
    moving = asyncio.create_task(controller.move_to_pose(LOW))
    await asyncio.sleep(0.05)
    stopping = asyncio.create_task(controller.stop())
    with pytest.raises(DeviceFault, match="not sent"):
        await moving
    await stopping
    await held
    assert not bench.world.moving
    assert [leg.position() for leg in bench.world.legs] == [0.0] * 3


async def test_somebody_else_stops_the_machine(bench: Bench, controller: GcsController):
    await bench.slow_move()
    with bench.station._lock:
        bench.station.controller.stop()
    with pytest.raises(DeviceFault, match="stopped"):
        await controller.wait_arrived(20.0)


async def test_channels(controller: GcsController):
    assert await controller.channels() == {"structure_temp_C": 20.25, "payload_kg": 1.5}


async def test_identity(controller: GcsController):
    assert controller.identity.kind == "gcs-controller"
    assert controller.identity.serial == "77"
