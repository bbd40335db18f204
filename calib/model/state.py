"""Values of a model's unknowns, and the model near them."""

from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array
from calib.effects.component import Situation
from calib.mechanism.configuration import Configuration


@dataclass(frozen=True, eq=False)
class State:
    """Values of all unknowns, and where the machine stands with them or with values nearby.

    ``parameters`` (P,), ``effects`` one (U,) for each effect, ``frame_rotation`` (3, 3, K) and
    ``frame_position`` (3, K) the base frame in the tracker frame of each run. ``near`` is what a
    linearisation has found, or only a configuration at which the machine may begin to close.
    """

    parameters: Array
    effects: tuple[Array, ...]
    frame_rotation: Array
    frame_position: Array
    near: Situation | Configuration | None = None
    setup: Array = field(default_factory=lambda: np.zeros(0))
    """Values (S,) of what of the setup is not exact: nests, planes, zeros."""

    @property
    def situation(self) -> Situation | None:
        """Where the machine stood when it was linearised; None before."""
        return self.near if isinstance(self.near, Situation) else None

    @property
    def configuration(self) -> Configuration | None:
        """Where the machine begins to close."""
        return self.near.closed if isinstance(self.near, Situation) else self.near


@dataclass(frozen=True, eq=False)
class Linearised:
    """The model near a state.

    ``residual`` (3, N) is measured minus predicted, mm, tracker frame; ``whitened`` (3, N) the
    same in sigmas; ``jacobian`` (p, 3, N) the whitened derivative of the prediction.
    """

    state: State
    residual: Array
    whitened: Array
    jacobian: Array

    @property
    def situation(self) -> Situation:
        """Where the machine stood."""
        assert self.state.situation is not None
        return self.state.situation
