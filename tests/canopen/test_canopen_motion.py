"""Motion over the wire: the controller uses the parameters that it holds."""

import asyncio

import numpy as np
import pytest
from canopen_bench import FAST_MM_PER_S, set_speed, until_state

from drivers.canopen import CanopenController
from drivers.errors import DeviceFault, Refused
from mocks.canopen.hexapod_kinematics import PARAMETERS, leg_lengths

HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)


async def go(controller: CanopenController, pose: tuple[float, ...]) -> tuple[float, ...]:
    targets = await controller.move_to_pose(pose)
    await controller.wait_arrived(20.0)
    return targets


def own_lengths(pose: tuple[float, ...], held: dict[str, float]) -> tuple[float, ...]:
    legs = [[held[f"leg{n}.{name}"] for name in PARAMETERS] for n in range(1, 7)]
    return leg_lengths(pose, legs)


async def test_targets_are_those_of_the_parameters_that_were_written(
    controller: CanopenController,
):
    seed = 7
    rng = np.random.default_rng(seed)
    held = await controller.read_parameters()
    held |= {n: held[n] + float(rng.uniform(-0.3, 0.3)) for n in controller.layout.kinematic}
    await controller.write_parameters(held)
    await controller.enable()
    for _ in range(10):
        pose = tuple(map(float, rng.uniform(-1, 1, 6) * [8, 8, 5, 0.08, 0.08, 0.1] + HOME))
        assert await go(controller, pose) == pytest.approx(own_lengths(pose, held), abs=1e-12)


async def test_extension_is_the_target_less_the_controller_s_own_reference(
    station, controller: CanopenController
):
    await controller.write_parameters({f"leg{n}.L0": 230.715 + 0.05 * n for n in range(1, 7)})
    await controller.enable()
    targets = await go(controller, (3.0, -2.0, 222.0, 0.02, 0.01, -0.03))
    extension = station.hands("truth")["extension"]
    expected = [q - 230.715 - 0.05 * n for n, q in enumerate(targets, start=1)]
    assert extension == pytest.approx(expected, abs=1e-9)


async def test_pitch_is_compensated_behind_the_target(station, controller: CanopenController):
    gain = 1e-3
    await controller.write_parameters({"screw-pitch.leg2": gain})
    await controller.enable()
    targets = await go(controller, (0.0, 0.0, 235.0, 0.0, 0.0, 0.0))
    wanted = targets[1] - 230.715
    extension = station.hands("truth")["extension"]
    assert extension[1] * (1 + gain) == pytest.approx(wanted, abs=1e-9)
    assert extension[0] == pytest.approx(targets[0] - 230.715, abs=1e-9)
    assert (await controller.state()).actuators[1].position == pytest.approx(targets[1], abs=1e-9)


async def test_backlash_is_compensated_by_the_direction_of_approach(
    station, controller: CanopenController
):
    await controller.write_parameters({"backlash.leg4": 0.04})
    await controller.enable()
    await go(controller, HOME)
    reached = []
    for z in (225.0, 222.0, 228.0, 222.0):
        targets = await go(controller, (0.0, 0.0, z, 0.0, 0.0, 0.0))
        reached.append(station.hands("truth")["extension"][3] - (targets[3] - 230.715))
    assert reached == pytest.approx([0.02, -0.02, 0.02, -0.02], abs=1e-9)


async def test_cyclic_table_repeats_with_its_period(station, controller: CanopenController):
    period, count = 5.0, 32
    table = {
        f"screw-cyclic-table.leg1.{k}": 0.01 * float(np.sin(2 * np.pi * k / count))
        for k in range(count)
    }
    await controller.write_parameters(table | {"screw-cyclic-table.leg1.period": period})
    await controller.enable()
    for z in (221.0, 224.0, 228.5):
        targets = await go(controller, (0.0, 0.0, z, 0.0, 0.0, 0.0))
        drive = station.hands("truth")["extension"][0]
        error = 0.01 * np.sin(2 * np.pi * drive / period)
        assert drive + error == pytest.approx(targets[0] - 230.715, abs=6e-5)


async def test_all_legs_arrive_together(station, enabled: CanopenController):
    await go(enabled, HOME)
    targets = await enabled.move_to_pose((10.0, -5.0, 225.0, 0.05, -0.03, 0.1))
    start = np.array([state.position for state in (await enabled.state()).actuators])
    now = np.array([state.position for state in (await enabled.state()).actuators])
    await enabled.wait_arrived(20.0)
    end = np.array([state.position for state in (await enabled.state()).actuators])
    np.testing.assert_allclose(end, targets, atol=1e-6)
    assert np.all(np.abs(end - now) <= np.abs(end - start) + 1e-9)
    assert not station.moving


@pytest.mark.parametrize("z", [300.0, 150.0])
async def test_pose_outside_the_travel_is_refused_and_nothing_moves(
    station, enabled: CanopenController, z: float
):
    await go(enabled, HOME)
    with pytest.raises(Refused, match=r"limits.*q1, q2"):
        await enabled.move_to_pose((0.0, 0.0, z, 0.0, 0.0, 0.0))
    assert not station.moving


async def test_pose_is_refused_while_motion_is_disabled(controller: CanopenController):
    with pytest.raises(Refused, match="not enabled"):
        await controller.move_to_pose(HOME)


@pytest.mark.parametrize("pose", [HOME[:5], (*HOME[:5], float("nan"))])
async def test_senseless_pose_is_refused_before_it_leaves(
    enabled: CanopenController, pose: tuple[float, ...]
):
    with pytest.raises(Refused, match="finite numbers"):
        await enabled.move_to_pose(pose)


async def test_move_to_q_goes_there(enabled: CanopenController):
    q = (228.0, 229.0, 230.0, 231.0, 232.0, 233.0)
    await enabled.move_to_q(q)
    await enabled.wait_arrived(20.0)
    state = await enabled.state()
    assert [a.position for a in state.actuators] == pytest.approx(q, abs=1e-9)
    assert [a.target for a in state.actuators] == pytest.approx(q, abs=1e-9)


async def test_jog_moves_one_actuator_alone(enabled: CanopenController):
    await go(enabled, HOME)
    before = (await enabled.state()).actuators
    await enabled.jog("q3", 225.5)
    after = (await enabled.state()).actuators
    assert after[2].position == pytest.approx(225.5, abs=2e-6)
    assert [a.position for a in after[:2]] == [a.position for a in before[:2]]
    await go(enabled, HOME)


async def test_jog_outside_the_travel_is_refused(enabled: CanopenController):
    with pytest.raises(Refused, match="q3"):
        await enabled.jog("q3", 266.0)


async def test_lost_reference_needs_homing(station, enabled: CanopenController):
    await go(enabled, (0.0, 0.0, 225.0, 0.0, 0.0, 0.0))
    station.hands("fault", name="reference-lost:5")
    await until_state(enabled, lambda state: not state.actuators[4].homed)
    with pytest.raises(Refused, match=r"reference.*q5.*Home"):
        await enabled.move_to_pose(HOME)
    await enabled.home("q5")
    state = (await enabled.state()).actuators[4]
    assert state.homed
    assert state.position == pytest.approx(230.715, abs=1e-6)
    await go(enabled, HOME)


async def test_stop_during_a_move_brakes_and_takes_the_power_off(station, slow: CanopenController):
    targets = await slow.move_to_pose((0.0, 0.0, 240.0, 0.0, 0.0, 0.0))
    await slow.stop()
    assert not station.moving
    with pytest.raises(DeviceFault, match="stopped before"):
        await slow.wait_arrived(2.0)
    await slow.stop()
    off = {"switch on disabled"}
    state = await until_state(slow, lambda s: {a.state for a in s.actuators} == off)
    assert all(abs(a.position - q) > 1.0 for a, q in zip(state.actuators, targets, strict=True))
    await slow.enable()
    await set_speed(slow, FAST_MM_PER_S)
    await go(slow, HOME)


async def test_stop_overtakes_a_long_transfer(controller: CanopenController):
    values = await controller.read_parameters()
    writing = asyncio.ensure_future(controller.write_parameters(values))
    await asyncio.sleep(0.01)
    await controller.stop()
    await writing


async def test_new_pose_during_a_move_wins(enabled: CanopenController):
    await enabled.move_to_pose((0.0, 0.0, 240.0, 0.0, 0.0, 0.0))
    targets = await go(enabled, (0.0, 0.0, 212.0, 0.0, 0.0, 0.0))
    state = await enabled.state()
    assert [a.position for a in state.actuators] == pytest.approx(targets, abs=1e-9)


async def test_channels_follow_the_machine(station, controller: CanopenController):
    station.hands("payload", kg=3.5)
    station.hands("temperature", structure_C=24.25)
    channels = await controller.channels()
    assert channels["payload_kg"] == 3.5
    assert channels["structure_temp_C"] == pytest.approx(24.25, abs=0.5)
