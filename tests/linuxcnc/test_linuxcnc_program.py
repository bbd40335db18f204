"""LinuxCNC itself, where it is installed: joints, parameters, and bad days."""

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from linuxcnc_bench import NOMINAL, Bench, keep_moving, lengths_at, ready, running, some_poses

from drivers.errors import ConnectFailed, DeviceFault, Refused
from mocks.linuxcnc.program import why_not

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(600),
    pytest.mark.skipif(bool(why_not()), reason=why_not() or "it is there"),
]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with running(tmp_path_factory.mktemp("linuxcnc")) as bench:
        yield bench


@pytest.fixture
def halcmd(bench: Bench) -> Callable[..., None]:
    def run(*words: str) -> None:
        env = {**os.environ, **bench.station.program.env}
        subprocess.run(["halcmd", *words], check=True, capture_output=True, env=env, timeout=20)

    return run


@pytest.mark.parametrize("lead", [0.0, 2.0])
async def test_joints_are_commanded_where_the_engine_has_them(bench: Bench, lead: float) -> None:
    values = {**NOMINAL, "leg1.B_x": NOMINAL["leg1.B_x"] + 0.123456789, "screw-twist.L": lead}
    async with bench.driver() as controller:
        await controller.write_parameters(values)
        assert (await controller.read_parameters()).items() >= values.items()
        await ready(controller)
        for pose in some_poses(6, seed=2):
            targets = await controller.move_to_pose(pose)
            await controller.wait_arrived(20.0)
            ours = lengths_at(pose, values)
            state = await controller.state()
            sent = [actuator.position for actuator in state.actuators]
            assert np.abs(targets - ours).max() < 1e-9
            assert np.abs(sent - ours).max() < 1e-9


async def test_backlash_is_taken_up_half_in_each_direction(bench: Bench) -> None:
    """Motors are sent ahead of the joint by half the backlash, in the direction of the move."""
    lost = 0.04
    pins = ["joint.0.motor-pos-cmd", "joint.0.pos-cmd", "joint.0.motor-offset"]
    async with bench.driver() as controller:
        before = await controller.read_parameters()
        await controller.write_parameters({"backlash.leg1": lost})
        await ready(controller)
        length, seen = None, []
        for pose in some_poses(8, seed=4):
            targets = await controller.move_to_pose(pose)
            await controller.wait_arrived(20.0)
            values = (await controller._ask("get", pins=pins))["values"]
            ahead = values[pins[0]] - values[pins[1]] - values[pins[2]]
            if length is not None:
                seen.append((float(np.sign(targets[0] - length)), ahead))
            length = targets[0]
        await controller.disable()
        await controller.write_parameters({"backlash.leg1": before["backlash.leg1"]})
    assert {direction for direction, _ in seen} == {-1.0, 1.0}
    for direction, ahead in seen:
        assert ahead == pytest.approx(0.5 * lost * direction, abs=1e-4)


async def test_another_ini_file_is_refused(bench: Bench, tmp_path: Path) -> None:
    other = tmp_path / "other.ini"
    text = bench.station.program.ini.read_text(encoding="utf-8")
    folder = bench.station.program.ini.parent
    other.write_text(text.replace("= hexapod.hal", f"= {folder}/hexapod.hal"), encoding="utf-8")
    with pytest.raises(Refused, match="LinuxCNC runs with"):
        async with bench.driver(ini=str(other)):
            pass


async def test_a_python_without_its_modules_is_told(bench: Bench) -> None:
    with pytest.raises(ConnectFailed, match="finds no LinuxCNC"):
        async with bench.driver(python="/bin/false"):
            pass
    with pytest.raises(ConnectFailed, match="cannot be started"):
        async with bench.driver(python="/no/python"):
            pass


async def test_other_normals_or_offsets_than_stated_are_refused(bench: Bench, halcmd) -> None:
    for pin, wrong, right in (
        ("genhexkins.base-n.0.z", "0.5", "0.0"),
        ("genhexkins.tool-offset", "12.0", "0.0"),
    ):
        halcmd("setp", pin, wrong)
        with pytest.raises(Refused, match=pin):
            async with bench.driver():
                pass
        halcmd("setp", pin, right)


async def test_a_pin_that_somebody_else_sets_is_read_and_a_move_by_it_is_not_hidden(
    bench: Bench, halcmd
) -> None:
    async with bench.driver() as controller:
        await ready(controller)
        before = await controller.read_parameters()
        checksum = await controller.parameter_checksum()
        halcmd("setp", "genhexkins.base.1.y", "173.9")
        assert (await controller.read_parameters())["leg2.B_y"] == 173.9
        assert await controller.parameter_checksum() != checksum
        halcmd("setp", "genhexkins.base.1.y", repr(before["leg2.B_y"]))


async def test_parameters_are_not_written_while_the_machine_is_on(bench: Bench) -> None:
    async with bench.driver() as controller:
        await ready(controller)
        before = await controller.read_parameters()
        with pytest.raises(Refused, match="is on"):
            await controller.write_parameters({"leg1.P_x": 80.0})
        assert await controller.read_parameters() == before


async def test_emergency_stop_is_a_fault_that_stands_until_it_is_released(
    bench: Bench, halcmd
) -> None:
    async with bench.driver() as controller:
        await ready(controller)
        halcmd("unlinkp", "iocontrol.0.emc-enable-in")
        halcmd("setp", "iocontrol.0.emc-enable-in", "0")
        with pytest.raises(DeviceFault, match="emergency stop"):
            await keep_moving(controller)
        with pytest.raises(DeviceFault, match="emergency stop"):
            await controller.clear_faults()
        halcmd("net", "estop-loop", "iocontrol.0.emc-enable-in")
        await controller.clear_faults()
        await ready(controller)
