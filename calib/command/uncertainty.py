"""How sure a model is of where the platform comes to: the covariance of what was identified."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.command.identified import Identified
from calib.command.standing import Standpoint
from calib.mechanism.jacobian import pose_jacobians


def pose_columns(identified: Identified, at: Standpoint) -> dict[str, Array]:
    """Twist (6, N) of the platform per unit of each parameter and unknown, base axes, by name."""
    names = [parameter.name for parameter in identified.machine.parameters]
    if not identified.effects:  # nothing else has to be asked
        twists = pose_jacobians(identified.closing, at.closed, identified.parameters).parameters
        return dict(zip(names, twists, strict=True))
    situation = at.situation
    columns = dict(zip(names, situation.state_twists, strict=True))
    for found in identified.effects:
        signature = found.effect.signature(situation, found.values)
        for k, name in enumerate(found.names):
            twist = np.zeros((6, situation.rows.count))
            if signature.extension is not None:
                twist += np.einsum("an,acn->cn", signature.extension[k], situation.actuator_twists)
            if signature.parameters is not None:
                twist += np.einsum("pn,pcn->cn", signature.parameters[k], situation.state_twists)
            if signature.twist is not None:
                twist += signature.twist[k]
            columns[name] = twist
    return columns


def pose_covariance(
    identified: Identified, at: Standpoint, names: Sequence[str], covariance: Array
) -> Array:
    """Covariance (6, 6, N) of the platform's twist, mm and rad, from that of the unknowns.

    Parameters
    ----------
    identified : Identified
    at : Standpoint
        Of :func:`calib.command.standing.standpoint`, or of commands.
    names, covariance : (p,), (p, p)
        Unknowns as they were identified; those that do not move the platform (frames, effects of
        the measurement) are passed over.
    """
    columns = pose_columns(identified, at)
    kept = [k for k, name in enumerate(names) if name in columns]
    stacked = np.array([columns[names[k]] for k in kept])
    count = at.closed.count
    stacked = stacked.reshape(len(kept), 6, count)
    spread = covariance[np.ix_(kept, kept)] @ stacked.reshape(len(kept), -1)
    return np.asarray(np.einsum("pcn,pdn->cdn", stacked, spread.reshape(stacked.shape)))
