"""Moves: absolute, so that a move in doubt is simply commanded again."""

import asyncio
from functools import partial

import numpy as np

from app.files.pose_table import HOME, Pose
from app.hosted.controller import HostedController
from app.session.answered import must_be_within_reach, must_belong
from app.session.events import LivePose, PoseCommanded
from app.session.plan import Step
from app.session.routines.conditions import channels
from app.session.rows import NewRow
from app.session.work import Done, Work
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.mechanism.task import FULL, task_values

_SAME = 1e-6
"""Actuator targets nearer than this (mm, rad) are the same."""
_LIVE_S = 0.2


async def home(work: Work, step: Step) -> Done:
    """Go to the home pose."""
    await ensure_at(work, HOME)
    return Done("at home")


async def move(work: Work, step: Step) -> Done:
    """Go to a pose of the plan."""
    await ensure_at(work, step.args["pose"])
    return Done(f"at pose {step.args['pose']}", {"q": work.memory.q})


async def exercise(work: Work, step: Step) -> Done:
    """Go round poses until the time is over: whole rounds, as only their ways were checked.

    A machine that a person moves is only given the time.
    """
    begun, seconds = work.clock.now(), 60.0 * float(step.args["minutes"])
    if isinstance(work.controller, HostedController) and work.controller.by_hand:
        await asyncio.sleep(work.clock.to_wall(seconds))
    rounds = 0
    while work.clock.now() - begun < seconds:
        for label in step.args["poses"]:
            await go(work, label)
        rounds += 1
    return Done(f"{rounds} rounds in {(work.clock.now() - begun) / 60.0:.1f} min")


async def ensure_at(work: Work, label: str) -> None:
    """Let the machine stand at a pose: nothing to do where it does already."""
    if work.memory.standing_at != label:
        await go(work, label)


async def go(work: Work, label: str) -> None:
    """Command a pose, write down the controller's targets, and wait for the arrival.

    The row is written as soon as the controller accepted: whatever happens then, the journal
    knows where the machine was sent, which the direction of approach depends on. Where a person
    moves the machine it is written on arrival, with the actuator values that were reached.
    """
    await approach(work, label, work.pose(label))
    work.memory.standing_at = label


async def approach(work: Work, label: str, pose: Pose) -> None:
    """As :func:`go`, to a pose on the way to one of the plan: the machine then stands at none."""
    memory = work.memory
    memory.standing_at, memory.settled = None, False
    if isinstance(work.controller, HostedController):
        work.controller.told({"delay_s": memory.delay_s, **await channels(work)})
        work.controller.ask_with(partial(_ask_for_pose, work, label))
    q = await work.controller.move_to_pose(commanded_coordinates(work.site.machine, pose))
    hosted = isinstance(work.controller, HostedController)
    by_hand = isinstance(work.controller, HostedController) and work.controller.by_hand
    if not hosted:
        must_belong(work.site.machine, work.controller_parameters, pose, q)
    if not by_hand:
        _write_move(work, label, q)
    work.tell(PoseCommanded(label, pose, q, work.clock.now()))
    live = asyncio.create_task(_show_move(work), name="live pose")
    try:
        await work.controller.wait_arrived(_timeout(work))
    finally:
        live.cancel()
        await asyncio.gather(live, return_exceptions=True)
    if by_hand:
        # Where a person brought it is known once it is there, and may be beside what was asked.
        q = tuple(one.position for one in (await work.controller.state()).actuators)
        _write_move(work, label, q)
    memory.arrived_s = work.clock.now()
    work.tell(LivePose(q, q, moving=False))


def _write_move(work: Work, label: str, q: tuple[float, ...]) -> None:
    """Write down where the machine was sent, in its actuators."""
    work.memory.q = q
    row = NewRow("move", work.clock.now(), label, q)
    work.journal.add_row(work.step, work.attempt, work.clock.utc(), row)


async def nudge(work: Work, controller: HostedController, q: tuple[float, ...]) -> None:
    """Move to actuator values near the pose where the machine stands, which is none of the plan."""
    memory = work.memory
    memory.standing_at, memory.settled = None, False
    memory.q = await controller.move_to_actuators(q)
    row = NewRow("move", work.clock.now(), "", memory.q)
    work.journal.add_row(work.step, work.attempt, work.clock.utc(), row)
    await controller.wait_arrived(_timeout(work))
    memory.arrived_s = work.clock.now()


async def _ask_for_pose(
    work: Work, label: str, text: str, choices: tuple[str, ...], typed: str
) -> str:
    """Ask the person who moves the machine; unattended, nobody does."""
    return await work.ask(f"Pose {label}. {text}", choices, typed=typed)


def commanded_coordinates(machine: Machine, pose: Pose) -> tuple[float, ...]:
    """The coordinates that a controller takes: all six, a position, or tilt and azimuth."""
    task = machine.task
    values = task_values(task, Poses.from_xyz_rpy(np.array(pose)[:, None]))
    return pose if task.coordinates == FULL else tuple(float(v) for v in values[:, 0])


def _timeout(work: Work) -> float:
    """Wall seconds that a move may take."""
    return work.clock.to_wall(work.limits.move_timeout_s) + 5.0


async def _show_move(work: Work) -> None:
    while True:
        await asyncio.sleep(_LIVE_S)
        state = await work.controller.state()
        q = tuple(actuator.position for actuator in state.actuators)
        target = tuple(actuator.target for actuator in state.actuators)
        work.tell(LivePose(q, target, state.moving))


async def take_stock(work: Work) -> None:
    """Ask the controller where the machine was last sent; a row where the journal says otherwise.

    After a kill the last command may not be in the journal, and between two sessions somebody may
    have moved the machine by hand.
    """
    state = await work.controller.state()
    q = tuple(actuator.target for actuator in state.actuators)
    homed = [actuator.homed for actuator in state.actuators]
    must_be_within_reach(work.site.machine, q, homed)
    last = work.journal.last_row()
    same = last is not None and all(abs(a - b) < _SAME for a, b in zip(q, last.q, strict=True))
    work.memory.q = q
    work.memory.standing_at = None
    if last is not None and same and not state.moving and state.enabled:
        work.memory.standing_at = last.pose or HOME
        work.memory.arrived_s = last.time_s
    elif not same:
        row = NewRow("move", work.clock.now(), "", q)
        work.journal.add_row(work.step, work.attempt, work.clock.utc(), row)
