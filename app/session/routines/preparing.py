"""Before the first move and after the last: who is there, what they hold, may we, are we warm."""

import asyncio

from app.errors import StoppedByOperator
from app.hosted.controller import HostedController
from app.session.journal import FRAME, IDENTITIES, PARAMETERS
from app.session.known import compare_with_known
from app.session.path import check_waypoints, waypoints
from app.session.plan import Step
from app.session.routines.beam import choose_reflector
from app.session.routines.conditions import channels
from app.session.routines.moving import commanded_coordinates, take_stock
from app.session.work import Done, Work
from drivers.errors import DeviceFault, NotReady, Refused

_LOOK_S = 10.0
"""Machine seconds between two looks at the channels while warming up."""
_PATIENCE = 30.0
"""How many times the warm-up span the machine may take to become steady."""


async def connect(work: Work, step: Step) -> Done:
    """Compare what the controller holds with what the model expects; take stock of the machine.

    Raises
    ------
    ParameterError
        If values are missing, not finite, or not those that this program last left there.
    """
    await work.station.connect()
    await _clear_old_faults(work)
    work.guarded = True
    held = await compare_with_known(work.site, work.controller, work.expected)
    first = work.controller_parameters
    if first and first != held.values:
        work.alarm(
            "controller",
            "its parameters are not those that this session began with",
            "Undo to the earlier set, or measure anew",
        )
        raise Refused(
            "the controller's parameters changed since this session began",
            device="controller",
            remedy="Bring them back with pkmcal undo, or measure anew",
        )
    identities = {
        "controller": vars(work.controller.identity),
        work.station.measures: vars(work.station.measuring.identity),
    }
    work.journal.set_meta(PARAMETERS, held.values)
    work.journal.set_meta(IDENTITIES, identities)
    if isinstance(work.controller, HostedController):
        work.journal.set_meta(FRAME, await work.controller.frame())
    await take_stock(work)
    return Done(f"{len(held.values)} parameters as expected", {"checksum": held.checksum})


async def _clear_old_faults(work: Work) -> None:
    """Clear what stands from before, for example that the PC went away; the drives are off."""
    try:
        work.station.check()
    except DeviceFault as fault:
        text = f"A fault stands from before: {str(fault).rstrip('.')}. Clear it and go on?"
        if await work.ask(text, ("clear", "stop"), "clear") == "stop":
            raise StoppedByOperator(f"stopped because of a standing fault: {fault.what}") from None
        await work.controller.clear_faults()
        work.station.check()


async def check_path(work: Work, step: Step) -> Done:
    """Check every pose and the way between them against all limits, before anything moves."""
    path = waypoints(work.plan)
    poses = [work.pose(label) for label in path]
    sent = None
    if isinstance(work.controller, HostedController):
        coordinates = [commanded_coordinates(work.site.machine, pose) for pose in poses]
        sent = await work.controller.would_send(coordinates, path)
    least = check_waypoints(work.site.machine, work.controller_parameters, poses, path, sent)
    return Done(f"{len(path)} moves, {least:.1f} mm or more from every actuator limit")


async def tracker(work: Work, step: Step) -> Done:
    """Initialise the tracker and choose the reflector."""
    await work.tracker.initialize()
    await choose_reflector(work)
    state = await work.tracker.state()
    if not state.initialized:
        raise NotReady(
            "not initialised although it was asked to be",
            device="tracker",
            remedy="Look at the tracker's own controller, then go on",
        )
    work.memory.aimed_at = ""
    face = f", face {state.face}" if work.tracker.can.faces else ""
    return Done(f"ready, reflector {state.reflector or 'as it was'}{face}")


async def drives(work: Work, step: Step) -> Done:
    """Power on, and every actuator that has lost its reference is homed."""
    await work.controller.enable()
    state = await work.controller.state()
    homed = [actuator.name for actuator in state.actuators if not actuator.homed]
    if homed and not work.controller.can.homes:
        raise Refused(
            f"{', '.join(homed)} have lost their reference, and it cannot be found from here",
            device="controller",
            remedy="Reference the machine as its maker says, then go on",
        )
    for name in homed:
        await work.controller.home(name)
    if homed:
        work.memory.standing_at = None
    return Done(f"drives on, {len(homed)} homed" if homed else "drives on")


async def warm_up(work: Work, step: Step) -> Done:
    """Wait for the laser, then watch the temperatures until they are steady."""
    span, limit = work.limits.warm_up_s, work.limits.warm_up_K_per_min
    begun = work.clock.now()
    waited = False
    while work.site.gauge is None and not (await work.tracker.state()).laser_warm:
        if not waited:
            work.suspended("the laser is not warm yet", "Wait; it takes minutes after power-on")
        waited = True
        _be_patient(work, begun, span, "the tracker's laser does not get warm")
        await asyncio.sleep(work.clock.to_wall(_LOOK_S))
    if waited:
        work.released("the laser is warm")
    seen = [(work.clock.now(), await channels(work))]
    while seen[-1][0] - seen[0][0] < span or _slope(seen) > limit:
        _be_patient(work, begun, span, f"temperatures change by more than {limit:g} K/min")
        await asyncio.sleep(work.clock.to_wall(min(_LOOK_S, span / 4.0)))
        seen.append((work.clock.now(), await channels(work)))
        while len(seen) > 2 and seen[-1][0] - seen[1][0] >= span:
            seen.pop(0)
    return Done(f"steady: {_slope(seen):.2f} K/min", {"channels": seen[-1][1]})


def _be_patient(work: Work, begun: float, span: float, why: str) -> None:
    if work.clock.now() - begun > _PATIENCE * max(span, 60.0):
        raise NotReady(why, device="warm-up", remedy="Find the cause, then go on")


def _slope(seen: list[tuple[float, dict[str, float]]]) -> float:
    """Fastest change of any temperature over the span, K/min."""
    (t0, first), (t1, last) = seen[0], seen[-1]
    changes = [abs(last[k] - first[k]) for k in last if k.endswith("temp_C") and k in first]
    return max(changes, default=0.0) / max((t1 - t0) / 60.0, 1e-3)


async def rest(work: Work, step: Step) -> Done:
    """Take the power off the drives."""
    await work.controller.disable()
    return Done("drives off")
