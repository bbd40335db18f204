"""Laws of drives that take actuator values and know no kinematics."""

import asyncio

from drivers.contract.bench import Law, MotorsBench, hold, refuses
from drivers.contract.moving import MOVING_LAWS, NEAR, connected, moved
from drivers.errors import DeviceFault
from drivers.interface import Motors

STRAIGHT = 0.05
"""Part of the way by which actuators that move together may be apart, as they are read."""


async def _moves(bench: MotorsBench) -> None:
    async with connected(bench, enabled=True) as motors:
        for which in (0, 1, 0):
            async with asyncio.timeout(bench.longest_s):
                await moved(motors, bench, which)
            state = await motors.state()
            hold(not state.moving, "it has arrived, and moves")
            for (name, unit), wanted, axis in zip(
                bench.axes, bench.places[which], state.actuators, strict=True
            ):
                miss = abs(axis.position - wanted)
                hold(miss < NEAR[unit], f"{name} stands {miss:g} beside its target")
                hold(abs(axis.target - wanted) < NEAR[unit], f"{name}: its target is {axis.target}")


async def _looks(motors: Motors, bench: MotorsBench) -> list[list[float]]:
    """Parts of the way that every actuator has behind it, again and again while all move."""
    starts, ends = bench.places
    looks = []
    while (state := await motors.state()).moving:
        looks.append(
            [
                (axis.position - start) / (end - start)
                for axis, start, end in zip(state.actuators, starts, ends, strict=True)
            ]
        )
    return looks


async def _moves_together(bench: MotorsBench) -> None:
    async with connected(bench, enabled=True) as motors:
        await moved(motors, bench, 0)
        await bench.start(motors, 1)
        async with asyncio.timeout(bench.longest_s):
            looks = await _looks(motors, bench)
        await motors.wait_arrived(bench.longest_s)
        under_way = [look for look in looks if min(look) > STRAIGHT and max(look) < 1.0 - STRAIGHT]
        hold(bool(under_way), "nobody sees it move: the way is too short, or one goes before all")
        # The actuators are read one after the other, while they move: a busy computer spreads most.
        apart = sorted(max(look) - min(look) for look in under_way)[len(under_way) // 4]
        hold(apart < STRAIGHT, f"actuators are {apart:.3f} of the way apart")


async def _refuses_before_any_moves(bench: MotorsBench) -> None:
    async with connected(bench, enabled=True) as motors:
        await moved(motors, bench, 0)
        before = (await motors.state()).actuators
        await refuses(bench.start_out_of_reach(motors), bench.longest_s, "what is out of reach")
        short = motors.move_actuators(bench.places[1][:-1])
        await refuses(short, bench.longest_s, "a value too few")
        await asyncio.sleep(0.1)
        after = (await motors.state()).actuators
        for one, two, (name, unit) in zip(before, after, bench.axes, strict=True):
            drift = abs(one.position - two.position)
            hold(drift < NEAR[unit], f"it refuses, and {name} has moved")


async def _one_stops_all(bench: MotorsBench) -> None:
    assert bench.stall is not None
    async with connected(bench, enabled=True) as motors:
        await moved(motors, bench, 0)
        await bench.start(motors, 1)
        await bench.stall()
        error = await refuses(
            motors.wait_arrived(bench.longest_s), bench.longest_s, "an actuator that is blocked"
        )
        hold(isinstance(error, DeviceFault), f"an actuator that is blocked ends in {error!r}")
        await asyncio.sleep(bench.settle_s)
        hold(not (await motors.state()).moving, "one is blocked, and others move on")
        hold(not (await motors.state()).enabled, "one is blocked, and all have power")


async def _shows_no_parameters(bench: MotorsBench) -> None:
    async with connected(bench, enabled=False) as motors:
        hold(not motors.can.parameters, "it says that it holds parameters")


MOTORS_LAWS: tuple[Law[MotorsBench], ...] = (
    *MOVING_LAWS,
    Law("it moves its actuators and says where they stand", _moves),
    Law("actuators start and arrive together", _moves_together),
    Law("it refuses before any of them moves", _refuses_before_any_moves),
    Law("an actuator that is blocked stops all", _one_stops_all, ("stall",)),
    Law("it holds no parameters", _shows_no_parameters),
)
