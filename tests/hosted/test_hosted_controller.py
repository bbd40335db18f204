"""Motors with a host are a motion controller: the laws of controllers, and what the host adds."""

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from line_device import BareAxes, LineServer

from app.files.machines import load_machine
from app.hosted.controller import HostedController
from app.hosted.means import ByMotors
from app.hosted.parameters import ParameterSet
from app.hosted.store import HostStore
from calib.mechanism.solve import forward, inverse
from drivers.contract import (
    CONTROLLER_LAWS,
    MOTORS_LAWS,
    ControllerBench,
    Law,
    MotorsBench,
    why_not,
)
from drivers.errors import ParameterError, Refused
from drivers.interface import MotionController, Motors
from drivers.kind import ActuatorFacts, Surroundings

MACHINE = load_machine("hexapod")
FACTS = tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in MACHINE.actuators)
EXAMPLE = Path(__file__).parents[2] / "examples" / "line_motors" / "line_motors.py"
KIND = run_path(str(EXAMPLE))["KIND"]
HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)
POSE = (4.0, -7.0, 224.0, 0.03, -0.05, 0.02)


@contextlib.asynccontextmanager
async def device(*, forgets_halt: bool = False) -> AsyncIterator[LineServer]:
    axes = BareAxes(MACHINE.home_q, forgets_halt=forgets_halt)
    server = LineServer(axes, [a.limits for a in MACHINE.actuators])
    await server.open()
    try:
        yield server
    finally:
        await server.close()


async def connect(server: LineServer, folder: Path) -> HostedController:
    store = HostStore(folder, MACHINE)
    store.open()
    motors: Motors = await KIND.open(
        Surroundings(
            {"address": f"127.0.0.1:{server.port}", "silence_s": 2.0}, "", "hexapod", FACTS, {}
        )
    )
    return HostedController(MACHINE, ByMotors(motors, MACHINE), store)


@pytest.mark.parametrize("law", MOTORS_LAWS, ids=str)
async def test_the_example_alone_holds_the_laws_of_motors(law: Law[MotorsBench]) -> None:
    async with device() as server:

        async def opened() -> Motors:
            motors: Motors = await KIND.open(
                Surroundings(
                    {"address": f"127.0.0.1:{server.port}", "silence_s": 2.0}, "", "hexapod",
                    FACTS, {},
                )
            )  # fmt: skip
            return motors

        async def silence() -> None:
            server.silent = True

        home = tuple(fact.home for fact in FACTS)
        bench = MotorsBench(
            open=opened,
            longest_s=20.0,
            actuators=FACTS,
            places=(home, tuple(value + 12.0 + 3.0 * k for k, value in enumerate(home))),
            unreachable=(*home[:-1], FACTS[-1].limits[1] + 1.0),
            silence=silence,
        )
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


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
            actuators=FACTS,
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


# what was found beside the geometry


async def told(controller: HostedController, pose: tuple[float, ...], **channels: float):
    controller.told(channels)
    q = await controller.move_to_pose(pose)
    await controller.wait_arrived(5.0)
    return np.array(q)


@contextlib.asynccontextmanager
async def with_effects(
    folder: Path,
    values: dict[str, float],
    own: dict[str, str] | None = None,
    *,
    forgets_halt: bool = False,
) -> AsyncIterator[HostedController]:
    async with device(forgets_halt=forgets_halt) as server:
        controller = await connect(server, folder)
        nominal = await controller.read_parameters()
        await controller.replace_parameters(ParameterSet({**nominal, **values}, own or {}))
        await controller.enable()
        yield controller
        await controller.close()


async def test_lost_motion_is_made_up_for_in_the_direction_of_approach(tmp_path: Path) -> None:
    lost = {f"backlash.{limb.name}": 0.04 for limb in MACHINE.limbs}
    low, high = (0.0, 0.0, 210.0, 0.0, 0.0, 0.0), (0.0, 0.0, 230.0, 0.0, 0.0, 0.0)
    async with with_effects(tmp_path, lost) as controller:
        await told(controller, low)
        upwards = await told(controller, HOME)
        await told(controller, high)
        downwards = await told(controller, HOME)
    # The drive goes half the play farther than the leg, to either side.
    assert np.abs(upwards - downwards) == pytest.approx(0.04, abs=1e-9)


async def test_warm_legs_are_commanded_shorter_and_nobody_telling_is_said(tmp_path: Path) -> None:
    heard: list[str] = []
    async with with_effects(tmp_path, {"thermal-growth.a": 1.2e-5}) as controller:
        controller.on_alarm(lambda alarm: heard.append(alarm.what))
        cold = await told(controller, HOME, structure_temp_C=20.0)
        warm = await told(controller, HOME, structure_temp_C=25.0)
        assert not heard
        silent = await told(controller, HOME)
        await told(controller, HOME, structure_temp_C=float("nan"))
    length = MACHINE.nominal[MACHINE.index("leg1.L0")]
    assert (cold - warm) == pytest.approx(1.2e-5 * 5.0 * length, rel=0.05)
    assert silent == pytest.approx(cold, abs=1e-9)
    assert heard == ["nobody tells structure_temp_C: thermal-growth compensated for 20"]


OWN = """
[effect]
id = "door"
says = "the cabinet's door pulls"
expression = "k * door_open"
unknowns = { k = "mm" }
"""


async def test_an_operators_formula_is_compensated_and_its_text_is_in_the_store(
    tmp_path: Path,
) -> None:
    heard: list[str] = []
    values = {f"door.{axis.name}.k": 0.02 for axis in MACHINE.axes}
    async with with_effects(tmp_path, values, {"door": OWN}) as controller:
        controller.on_alarm(lambda alarm: heard.append(alarm.what))
        shut = await told(controller, HOME, door_open=0.0)
        wide = await told(controller, HOME, door_open=1.0)
        unknown = await told(controller, HOME)
        await controller.store_parameters()
    assert shut - wide == pytest.approx(0.02, abs=1e-9)
    assert unknown == pytest.approx(shut, abs=1e-9)
    assert heard == ["nobody tells door_open: door not compensated"]
    async with device() as server:
        again = await connect(server, tmp_path)
        assert again.chosen.own == {"door": OWN}
        assert (await again.read_parameters())["door.leg1.k"] == 0.02
        await again.close()


@pytest.mark.parametrize(
    ("values", "own", "says"),
    [
        ({"backlash.leg1": 0.01}, {}, "lacks a value of backlash"),
        ({"door.leg1.k": 0.01}, {}, "nor of an effect"),
        ({"tracker-scale.k": 1e-6}, {}, "no effect of the machine"),
        ({"door.leg1.k": 0.01}, {"door": "[effect]"}, "no unknowns are declared"),
    ],
)
async def test_effects_that_mean_nothing_are_refused(
    values: dict[str, float], own: dict[str, str], says: str, tmp_path: Path
) -> None:
    async with device() as server:
        controller = await connect(server, tmp_path)
        nominal = await controller.read_parameters()
        with pytest.raises(Refused, match=says):
            await controller.replace_parameters(ParameterSet({**nominal, **values}, own))
        assert await controller.read_parameters() == nominal
        await controller.close()


@pytest.mark.parametrize("forgets_halt", [False, True])
async def test_a_stop_on_the_way_is_remembered(tmp_path: Path, forgets_halt: bool) -> None:
    """After a stop the legs come from where they were stopped, not from where they were sent.

    Some drives go on telling the target that they were stopped short of.
    """
    lost = {f"backlash.{limb.name}": 0.04 for limb in MACHINE.limbs}
    low, high = (0.0, 0.0, 205.0, 0.0, 0.0, 0.0), (0.0, 0.0, 235.0, 0.0, 0.0, 0.0)
    async with with_effects(tmp_path, lost, forgets_halt=forgets_halt) as controller:
        await told(controller, low)
        upwards = await told(controller, HOME)
        await told(controller, low)
        await controller.move_to_pose(high)
        await controller.stop()  # at once: still below home
        again = await told(controller, HOME)
    assert again == pytest.approx(upwards, abs=1e-9)
