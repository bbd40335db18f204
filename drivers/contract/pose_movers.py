"""Laws of controllers that take poses and show no parameters."""

import asyncio

from drivers.contract.bench import Law, PoseBench, hold
from drivers.contract.moving import MOVING_LAWS, NEAR, connected, moved


async def _moves(bench: PoseBench) -> None:
    async with connected(bench, enabled=True) as mover:
        for which in (0, 1, 0):
            async with asyncio.timeout(bench.longest_s):
                await moved(mover, bench, which)
            state, told = await mover.state(), await mover.commanded_pose()
            hold(not state.moving, "it has arrived, and moves")
            for (name, unit), wanted, said, axis in zip(
                bench.axes, bench.poses[which], told, state.actuators, strict=True
            ):
                near = NEAR[unit]
                hold(abs(said - wanted) < near, f"{name}: told {wanted:g}, it says {said:g}")
                miss = abs(axis.position - wanted)
                hold(miss < near, f"{name} stands {miss:g} beside its target")


async def _shows_no_parameters(bench: PoseBench) -> None:
    async with connected(bench, enabled=False) as mover:
        hold(not mover.can.parameters, "it says that it holds parameters")


async def _says_what_its_poses_refer_to(bench: PoseBench) -> None:
    async with connected(bench, enabled=False) as mover:
        first = await mover.frame()
        hold(bool(first), "it does not say what its poses refer to")
        hold(all(first.values()), f"a word is empty: {first}")
        hold(await mover.frame() == first, "asked twice, its poses refer to two things")


POSE_LAWS: tuple[Law[PoseBench], ...] = (
    *MOVING_LAWS,
    Law("it moves to poses, and says the same of where it is", _moves),
    Law("it holds no parameters", _shows_no_parameters),
    Law("it says what its poses refer to", _says_what_its_poses_refer_to),
)
