"""What only a mock knows: where the platform really is. For judging, never for calibrating."""

from app.session.hands import MockControl
from app.session.plan import Step
from app.session.routines.moving import ensure_at
from app.session.work import Done, Work


async def truth(work: Work, step: Step) -> Done:
    """Ask the mock's control socket for the noise-free pose of the settled platform."""
    label = step.args["pose"]
    await ensure_at(work, label)
    control = MockControl(work.site.hands.host, work.site.hands.port)
    answer = await control.call("truth", settled=True)
    result = {"pose": label, "position": answer["position"], "rotation": answer["rotation"]}
    return Done("noted", result)
