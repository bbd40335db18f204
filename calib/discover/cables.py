"""Whether a run holds poses at which a cable would have to push."""

import numpy as np

from calib.effects.gravity_sag import weight_wrench, weightless
from calib.identify.fitting import Fit
from calib.mechanism.solve import forward
from calib.model.cables import cable_forces, has_cables

FAR = 2.0
"""Times what readings cannot tell, by which a rope is too long before it is called slack."""


def slack_cables(fitted: Fit) -> str:
    """Say which cables would have to push, where, and what to do; empty where none would."""
    rows, machine = fitted.model.rows, fitted.model.rows.machine
    if not has_cables(machine):
        return ""
    which = np.flatnonzero(fitted.accepted & rows.on_platform)
    _, first = np.unique(rows.extension[:, which], axis=1, return_index=True)
    at = which[np.sort(first)]
    parameters = fitted.linear.state.parameters
    closed = forward(machine, rows.extension[:, at], parameters)
    force, moment = weight_wrench(rows, fitted.linear.situation.rotation)
    found = cable_forces(machine, closed, parameters, force[:, at], moment[:, at])
    short = -found.force * found.compliance[:, None]
    unknown = np.nan_to_num(FAR * fitted.noise_floor_mm)
    slack = short > unknown
    if not slack.any():
        return ""
    names = ", ".join(
        f"{name} at {count}" for name, count in zip(found.names, slack.sum(axis=1), strict=True)
        if count
    )  # fmt: skip
    worst, pose = np.unravel_index(int(np.argmax(short)), short.shape)
    weight, count = weightless(rows), int(slack.any(axis=0).sum())
    return (
        f"Cables do not push, and some would have to at {count} of {at.size} "
        f"poses ({names}; most {found.names[worst]} at pose {rows.pose_name[at[pose]]}, "
        f"{found.force[worst, pose]:.0f} N). There they hang slack, and this model does not hold: "
        "leave these poses out or command more tension"
        + (f" (their weight is not counted: {weight})" if weight else "")
    )
