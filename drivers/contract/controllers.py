"""Laws of motion controllers."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from drivers.contract.bench import ControllerBench, Law, hold, refuses
from drivers.errors import DeviceError, ParameterError, Refused
from drivers.interface import ControllerCan, MotionController

NEAR = {"mm": 0.05, "rad": 1e-3}
"""How near to its target an actuator stands that has arrived."""
NUDGE = 1e-3


@asynccontextmanager
async def _connected(bench: ControllerBench, *, enabled: bool) -> AsyncIterator[MotionController]:
    """A driver, connected; if ``enabled`` with its drives on and referenced."""
    async with asyncio.timeout(bench.longest_s):
        controller = await bench.open()
    try:
        if enabled:
            await controller.enable()
            for actuator in (await controller.state()).actuators:
                if not actuator.homed and controller.can.homes:
                    await controller.home(actuator.name)
        yield controller
    finally:
        async with asyncio.timeout(bench.longest_s):
            await controller.close()


async def _says_who_it_is(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=False) as controller:
        hold(bool(controller.identity.kind), "its identity has no kind")
        hold(isinstance(controller.can, ControllerCan), "it does not say what it can")
        controller.check()
        state = await controller.state()
        names = tuple(actuator.name for actuator in state.actuators)
        wanted = tuple(actuator.name for actuator in bench.actuators)
        hold(names == wanted, f"its actuators are {names}, the machine's {wanted}")
        hold(all(math.isfinite(a.position) for a in state.actuators), "a position is no number")
        hold(not state.enabled and not state.moving, "it is on, or moves, before anybody asked")


async def _switches(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=True) as controller:
        hold((await controller.state()).enabled, "after enable() it says that it is off")
        await controller.disable()
        hold(not (await controller.state()).enabled, "after disable() it says that it is on")
        error = await refuses(_moved(controller, bench, 1), bench.longest_s, "a move while off")
        hold(isinstance(error, Refused), f"a move while off ends in {error!r}")


async def _moved(controller: MotionController, bench: ControllerBench, which: int) -> None:
    await controller.move_to_pose(bench.poses[which])
    await controller.wait_arrived(bench.longest_s)


async def _moves(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=True) as controller:
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


async def _refuses_poses(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=True) as controller:
        error = await refuses(
            controller.move_to_pose(bench.unreachable), bench.longest_s, "an unreachable pose"
        )
        hold(isinstance(error, Refused), f"an unreachable pose ends in {error!r}")
        not_a_number = (math.nan, *bench.poses[0][1:])
        await refuses(controller.move_to_pose(not_a_number), bench.longest_s, "a pose of nan")
        hold(not (await controller.state()).moving, "it refuses, and moves")
        await _moved(controller, bench, 0)


async def _stops(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=True) as controller:
        await _moved(controller, bench, 0)
        await controller.move_to_pose(bench.poses[1])
        waiting = asyncio.ensure_future(controller.wait_arrived(bench.longest_s))
        await asyncio.sleep(0)
        async with asyncio.timeout(bench.longest_s):
            await controller.stop()
            await controller.stop()
        await asyncio.wait([waiting], timeout=bench.longest_s)
        hold(waiting.done(), "who waits for the arrival waits on after a stop")
        waiting.exception()
        await asyncio.sleep(bench.settle_s)
        first = await controller.state()
        await asyncio.sleep(0.1)
        second = await controller.state()
        for one, two, facts in zip(first.actuators, second.actuators, bench.actuators, strict=True):
            drift = abs(one.position - two.position)
            hold(drift < NEAR[facts.unit], f"{facts.name} still moves after a stop")
        await controller.enable()
        await _moved(controller, bench, 0)


async def _keeps_parameters(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=False) as controller:
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
    async with _connected(bench, enabled=False) as controller:
        before = await controller.read_parameters()
        for value in (before[bench.parameter] + NUDGE, before[bench.parameter]):
            await controller.write_parameters({bench.parameter: value})
            await controller.store_parameters()
            await controller.reload_parameters()
            held = (await controller.read_parameters())[bench.parameter]
            hold(held == value, f"stored {value!r}, loaded {held!r}")


async def _names_channels(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=False) as controller:
        channels = await controller.channels()
        hold(set(channels) <= set(controller.can.channels), f"channels {sorted(channels)}")
        hold(all(map(math.isfinite, channels.values())), f"channels are {channels}")


async def _homes(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=True) as controller:
        name = bench.actuators[0].name
        async with asyncio.timeout(bench.longest_s):
            await controller.home(name)
        hold((await controller.state()).actuators[0].homed, "home() leaves it without reference")
        error = await refuses(controller.home("no such"), bench.longest_s, "homing nobody")
        hold(isinstance(error, Refused), f"homing nobody ends in {error!r}")


async def _notices_silence(bench: ControllerBench) -> None:
    assert bench.silence is not None
    async with _connected(bench, enabled=False) as controller:
        await bench.silence()
        await refuses(controller.enable(), bench.longest_s, "a silent device")


async def _closes(bench: ControllerBench) -> None:
    async with _connected(bench, enabled=False) as controller:
        async with asyncio.timeout(bench.longest_s):
            await controller.close()
            await controller.close()
        error = await refuses(controller.enable(), bench.longest_s, "a call after the end")
        hold(isinstance(error, DeviceError), f"a call after the end ends in {error!r}")


CONTROLLER_LAWS: tuple[Law[ControllerBench], ...] = (
    Law("it says who it is and what it can, and stands still", _says_who_it_is),
    Law("off, it refuses to move", _switches),
    Law("it moves to poses and says where it stands", _moves),
    Law("it refuses what it cannot reach, and goes on", _refuses_poses),
    Law("a stop ends every move", _stops),
    Law("parameters are read back bit for bit", _keeps_parameters, ("parameters", "parameter")),
    Law("stored parameters come back", _stores_parameters, ("parameters", "parameter")),
    Law("channels are those that it names", _names_channels),
    Law("it finds its reference", _homes, ("homes",)),
    Law("silence is a fault before a deadline", _notices_silence, ("silence",)),
    Law("after the end nothing answers, nothing hangs", _closes),
)
