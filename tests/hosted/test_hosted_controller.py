"""Motors with a host are a motion controller: the laws of controllers, and what the host adds."""

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest
from line_motors import LineMotors, LineServer

from app.files.machines import load_machine
from app.hosted.controller import HostedController
from app.hosted.means import ByMotors
from app.hosted.store import HostStore
from calib.mechanism.solve import forward, inverse
from drivers.contract import CONTROLLER_LAWS, ControllerBench, Law, why_not
from drivers.errors import ParameterError, Refused
from drivers.interface import MotionController
from drivers.kind import ActuatorFacts

MACHINE = load_machine("hexapod")
NAMES = [actuator.name for actuator in MACHINE.actuators]
HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)
POSE = (4.0, -7.0, 224.0, 0.03, -0.05, 0.02)


@contextlib.asynccontextmanager
async def device() -> AsyncIterator[LineServer]:
    server = LineServer(list(MACHINE.home_q), [a.limits for a in MACHINE.actuators])
    await server.open()
    try:
        yield server
    finally:
        await server.close()


async def connect(server: LineServer, folder: Path) -> HostedController:
    store = HostStore(folder, MACHINE)
    store.open()
    motors = await LineMotors.connect(server.port, NAMES)
    return HostedController(MACHINE, ByMotors(motors, MACHINE), store)


@pytest.mark.parametrize("law", CONTROLLER_LAWS, ids=str)
async def test_it_holds_the_laws_of_controllers(law: Law[ControllerBench], tmp_path: Path) -> None:
    async with device() as server:

        async def opened() -> MotionController:
            return await connect(server, tmp_path)

        async def silence() -> None:
            server.silent = True

        bench = ControllerBench(
            open=opened,
            longest_s=20.0,
            actuators=tuple(
                ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in MACHINE.actuators
            ),
            poses=(HOME, (0.0, 0.0, 206.0, 0.0, 0.0, 0.0)),
            unreachable=(0.0, 0.0, 5000.0, 0.0, 0.0, 0.0),
            parameter="leg1.B_x",
            silence=silence,
            settle_s=0.1,
        )
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


async def test_the_drives_get_the_legs_of_the_set_in_use(tmp_path: Path) -> None:
    generator = np.random.default_rng(5)
    values = MACHINE.nominal + 0.3 * generator.standard_normal(MACHINE.nominal.size)
    async with device() as server:
        controller = await connect(server, tmp_path)
        names = [p.name for p in MACHINE.parameters]
        await controller.write_parameters(dict(zip(names, map(float, values), strict=True)))
        await controller.enable()
        told = await controller.move_to_pose(POSE)
        await controller.wait_arrived(5.0)
        q = np.array([a.position for a in (await controller.state()).actuators])
        await controller.close()
    assert told == server.sent[-1]
    # The machine that the set describes, its legs where the drives are, stands at the pose.
    stands = forward(MACHINE, MACHINE.extension(q[:, None]), values)
    assert stands.poses.to_xyz_rpy()[:, 0] == pytest.approx(POSE, abs=1e-9)


async def test_better_parameters_do_not_move_the_drives_zero(tmp_path: Path) -> None:
    """A longer L0 is a shorter extension at the same pose; q refers to the drawing."""
    async with device() as server:
        controller = await connect(server, tmp_path)
        longer = {f"{limb.name}.L0": 231.0 for limb in MACHINE.limbs}
        await controller.write_parameters(longer)
        await controller.enable()
        q = await controller.move_to_pose(HOME)
        await controller.close()
    parameters = MACHINE.vector(longer)
    closed = inverse(MACHINE, np.array(HOME)[:, None], parameters)
    assert q == pytest.approx(MACHINE.coordinates(closed.extension)[:, 0], abs=1e-12)


async def test_parameters_are_not_changed_under_power(tmp_path: Path) -> None:
    async with device() as server:
        controller = await connect(server, tmp_path)
        await controller.enable()
        with pytest.raises(Refused, match="while a drive has power"):
            await controller.write_parameters({"leg1.L0": 230.0})
        await controller.close()


async def test_a_trial_ends_with_the_program(tmp_path: Path) -> None:
    async with device() as server:
        controller = await connect(server, tmp_path)
        before = await controller.read_parameters()
        await controller.write_parameters({"leg1.L0": 230.0})
        await controller.close()
        again = await connect(server, tmp_path)
        assert await again.read_parameters() == before
        await again.close()


async def test_a_broken_store_moves_nothing_until_a_whole_set_is_back(tmp_path: Path) -> None:
    async with device() as server:
        controller = await connect(server, tmp_path)
        good = await controller.read_parameters()
        await controller.store_parameters()
        await controller.close()
        path = HostStore(tmp_path, MACHINE).path(1)
        path.write_text(path.read_text(encoding="utf-8")[:-200], encoding="utf-8")
        controller = await connect(server, tmp_path)
        await controller.enable()
        for deed in (
            controller.move_to_pose(HOME),
            controller.read_parameters(),
            controller.parameter_checksum(),
            controller.store_parameters(),
            controller.reload_parameters(),
        ):
            with pytest.raises(ParameterError, match="undo --to"):
                await deed
        assert server.sent == []
        await controller.disable()
        with pytest.raises(Refused, match="are missing"):
            await controller.write_parameters({"leg1.L0": 230.0})
        await controller.write_parameters(good)
        await controller.store_parameters()
        await controller.reload_parameters()
        assert await controller.read_parameters() == good
        await controller.close()


async def test_poses_are_checked_as_they_would_be_sent(tmp_path: Path) -> None:
    async with device() as server:
        controller = await connect(server, tmp_path)
        sent = await controller.would_send([HOME, POSE], ["home", "a"])
        await controller.enable()
        q = await controller.move_to_pose(POSE)
        await controller.close()
    assert q == pytest.approx(MACHINE.coordinates(sent)[:, 1], abs=1e-12)
