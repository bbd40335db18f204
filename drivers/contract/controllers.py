"""Laws of motion controllers."""

import asyncio
import math

from drivers.contract.bench import ControllerBench, Law, hold, refuses
from drivers.contract.moving import MOVING_LAWS, NEAR, connected
from drivers.errors import ParameterError, Refused

NUDGE = 1e-3


async def _moves(bench: ControllerBench) -> None:
    async with connected(bench, enabled=True) as controller:
        for pose in (bench.poses[0], bench.poses[1], bench.poses[0]):
            async with asyncio.timeout(bench.longest_s):
                targets = await controller.move_to_pose(pose)
                await controller.wait_arrived(bench.longest_s)
            state = await controller.state()
            hold(not state.moving, "it has arrived, and moves")
            for facts, target, actuator in zip(
                bench.actuators, targets, state.actuators, strict=True
            ):
                low, high = facts.limits
                hold(low <= target <= high, f"{facts.name} is sent to {target:g}")
                miss = abs(actuator.position - target)
                hold(miss < NEAR[facts.unit], f"{facts.name} stands {miss:g} beside its target")


async def _keeps_parameters(bench: ControllerBench) -> None:
    async with connected(bench, enabled=False) as controller:
        before = await controller.read_parameters()
        checksum = await controller.parameter_checksum()
        changed = before[bench.parameter] + NUDGE
        await controller.write_parameters({bench.parameter: changed})
        held = await controller.read_parameters()
        hold(held == {**before, bench.parameter: changed}, "it holds others than were written")
        hold(await controller.parameter_checksum() != checksum, "the checksum did not change")
        await controller.reload_parameters()
        hold(await controller.read_parameters() == before, "reload brings others back")
        hold(await controller.parameter_checksum() == checksum, "reload: another checksum")
        for values in ({"no.such": 1.0}, {bench.parameter: math.nan}):
            error = await refuses(
                controller.write_parameters(values), bench.longest_s, f"writing {values}"
            )
            hold(isinstance(error, Refused | ParameterError), f"writing {values}: {error!r}")
        hold(await controller.read_parameters() == before, "a refused write changed something")


async def _stores_parameters(bench: ControllerBench) -> None:
    async with connected(bench, enabled=False) as controller:
        before = await controller.read_parameters()
        for value in (before[bench.parameter] + NUDGE, before[bench.parameter]):
            await controller.write_parameters({bench.parameter: value})
            await controller.store_parameters()
            await controller.reload_parameters()
            held = (await controller.read_parameters())[bench.parameter]
            hold(held == value, f"stored {value!r}, loaded {held!r}")


CONTROLLER_LAWS: tuple[Law[ControllerBench], ...] = (
    *MOVING_LAWS,
    Law("it moves to poses and says where it stands", _moves),
    Law("parameters are read back bit for bit", _keeps_parameters, ("parameters", "parameter")),
    Law("stored parameters come back", _stores_parameters, ("parameters", "parameter")),
)
