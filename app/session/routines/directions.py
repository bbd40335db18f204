"""Before the first large move of drives alone: each actuator by itself, a little."""

import numpy as np

from app.files.pose_table import HOME
from app.hosted.controller import HostedController
from app.hosted.directions import complaints, displacements, small_ways
from app.session.plan import Step
from app.session.routines.beam import measured
from app.session.routines.carrying import ensure_smr
from app.session.routines.moving import ensure_at, nudge
from app.session.work import Done, Work
from calib.arrays import Array
from drivers.errors import Refused

_LOOK_S = 0.5


async def directions(work: Work, step: Step) -> Done:
    """Move every actuator alone by a little, and compare where a nest goes with the drawing.

    Raises
    ------
    Refused
        Naming every actuator that moves otherwise, after the machine is back at home.
    """
    controller, nest = work.controller, step.args["nest"]
    if not isinstance(controller, HostedController):
        return Done("the controller computes the motion")
    if controller.by_hand:
        return Done("a person moves the machine, and sees which way it goes")
    machine = controller.machine
    await ensure_smr(work, nest)
    await ensure_at(work, HOME)
    q = np.array([actuator.target for actuator in (await controller.state()).actuators])
    extension = machine.extension(q[:, None])[:, 0]
    parameters = machine.vector(
        {p.name: controller.chosen.values[p.name] for p in machine.parameters}
    )
    point = np.array(work.site.platform_nests[nest])
    ways = small_ways(machine, parameters, extension, point)
    drawn = displacements(machine, parameters, extension, point, ways)
    names = [actuator.name for actuator in machine.actuators]
    first, sigma = await _place(work, nest)
    seen = np.zeros(drawn.shape)
    for n, way in enumerate(ways):
        one = np.zeros(ways.size)
        one[n] = way
        await nudge(work, controller, tuple(q + one))
        seen[:, n] = (await _place(work, nest))[0] - first
    await ensure_at(work, HOME)
    origin = work.memory.frame.apply(np.zeros(3))
    turned = np.stack([work.memory.frame.apply(d) - origin for d in drawn.T], axis=1)
    wrong, unsaid = complaints(names, turned, seen, np.sqrt(2.0) * sigma)
    if wrong:
        raise Refused(
            f"{'; '.join(wrong)}. Each was moved alone, by little, and nest {nest} was measured",
            device="drives",
            remedy="Correct sign, nodes or counts_per_unit under [controller] of the site file",
        )
    for name in unsaid:
        work.alarm("drives", f"whether {name} moves as drawn cannot be seen at nest {nest}")
    return Done(f"{len(names) - len(unsaid)} actuators move nest {nest} as drawn")


async def _place(work: Work, nest: str) -> tuple[Array, float]:
    """Where a nest is seen, mm, and the standard uncertainty of that."""
    reading, _ = await measured(work, nest, _LOOK_S)
    return np.array(reading.xyz), float(np.sqrt(sum(reading.covariance[:3])))
