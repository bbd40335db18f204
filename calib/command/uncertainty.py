"""How sure a model is of where the platform comes to: the covariance of what was identified."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.command.identified import Identified
from calib.command.standing import Standpoint


def pose_columns(at: Standpoint) -> Array:
    """Twist (C, 6, N) of the platform per unit of each parameter and unknown, base axes.

    In the order of :attr:`Identified.names`.
    """
    jacobians = at.jacobians
    columns = [jacobians.parameters]
    for own in at.changes.signatures:
        moved: Array | None = own.twist
        for shape, slope in (
            (own.extension, jacobians.actuators),
            (own.parameters, jacobians.parameters),
        ):
            if shape is not None:
                more = np.einsum("uan,acn->ucn", shape, slope)
                moved = more if moved is None else moved + more
        assert moved is not None  # what moves no machine is in no command
        columns.append(moved)
    return np.concatenate(columns)


class PoseCovariance:
    """Covariance of where the platform comes to, prepared for one model.

    Parameters
    ----------
    identified : Identified
    names, covariance : (p,), (p, p)
        Unknowns as they were identified; those that do not move the platform (frames, effects of
        the measurement) are passed over.
    """

    def __init__(self, identified: Identified, names: Sequence[str], covariance: Array) -> None:
        place = {name: k for k, name in enumerate(identified.names)}
        kept = [k for k, name in enumerate(names) if name in place]
        self._columns = np.array([place[names[k]] for k in kept], dtype=np.intp)
        self._covariance = covariance[np.ix_(kept, kept)]

    def at(self, standing: Standpoint) -> Array:
        """Covariance (6, 6, N) of the platform's twist, mm and rad.

        Parameters
        ----------
        standing : Standpoint
            Of :func:`calib.command.standing.standpoint`, or of commands.
        """
        moved = pose_columns(standing)[self._columns]
        spread = (self._covariance @ moved.reshape(len(moved), -1)).reshape(moved.shape)
        return np.asarray(np.einsum("pcn,pdn->cdn", moved, spread))
