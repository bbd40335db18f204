"""The state of things, as controller, tracker and site file tell it."""

from app.session.work import Work
from drivers import plausible

_CHANNELS_AGE_S = 8.0


async def channels(work: Work) -> dict[str, float]:
    """Everything that controller and tracker say about the state of things.

    Asked anew when the last answer is older than a few machine seconds: the nests of one pose
    share it, temperatures are slower. A payload that no device tells is as the site file says.
    """
    asked, known = work.memory.channels
    if not known or work.clock.now() - asked > _CHANNELS_AGE_S:
        tracker_says = {} if work.site.gauge else await work.tracker.channels()
        payload = work.site.payload_kg
        typed = {} if payload is None else {"payload_kg": payload}
        controller_says = await work.controller.channels()
        plausible.channels(controller_says, "controller")
        known = {**typed, **tracker_says, **controller_says}
        work.memory.channels = (work.clock.now(), known)
    return dict(known)
