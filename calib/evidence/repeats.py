"""Repeatability first: what does not repeat cannot be explained by a function of the state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, IntArray
from calib.chance import chi2_above


@dataclass(frozen=True)
class PureError:
    """Scatter of repeats about their own mean.

    Attributes
    ----------
    dof : int
        Components beyond the first of each repeated state; 0 if nothing was repeated.
    variance : float
        In units of the stated one: 1 means that repeats scatter as the readings' sigmas say.
    p_value : float
        Probability of that much or more if the sigmas are right.
    excess : float
        Of the misfit beyond the stated noise, the part that does not repeat: no function of the
        state can explain it. 0 if there is no misfit.
    """

    dof: int
    variance: float
    p_value: float
    excess: float


def pure_error(
    residual: Array, states: Sequence[object], dof: float, components: IntArray | None = None
) -> PureError:
    """Compare repeats of the same state (pose, nest, direction of approach ...).

    Parameters
    ----------
    residual : (c, N)
        Whitened residual of each of N readings.
    states : sequence of N labels
        Readings with the same label are repeats; None belongs to no state.
    dof : float
        Degrees of freedom of the whole fit (components minus tr H).
    components : (N,), optional
        How many components each reading holds, if not all c; repeats hold the same.
    """
    groups: dict[object, list[int]] = {}
    for index, state in enumerate(states):
        if state is not None:
            groups.setdefault(state, []).append(index)
    squares, freedom = 0.0, 0
    for members in groups.values():
        if len(members) > 1:
            here = residual[:, members]
            squares += float(np.sum((here - here.mean(axis=1, keepdims=True)) ** 2))
            held = residual.shape[0] if components is None else int(components[members].min())
            freedom += held * (len(members) - 1)
    if freedom == 0:
        return PureError(0, float("nan"), float("nan"), 0.0)
    misfit = max(float(np.sum(residual**2)) - dof, 0.0)
    beyond = max(squares - freedom, 0.0)
    return PureError(
        dof=freedom,
        variance=squares / freedom,
        p_value=float(chi2_above(freedom, squares)),
        excess=min(beyond / misfit, 1.0) if misfit > 0.0 else 0.0,
    )
