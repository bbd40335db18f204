"""Values of a model's unknowns, and the model near them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

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


class Derivatives:
    """Whitened derivatives (p, 3, N) of a prediction: by far the largest array, made when asked.

    A step that is only tried asks for its residuals alone.
    """

    def __init__(self, make: Callable[[], Array]) -> None:
        self._make: Callable[[], Array] | None = make

    @cached_property
    def value(self) -> Array:
        """The derivatives; what they are made of is let go."""
        assert self._make is not None
        made, self._make = self._make(), None
        return made


@dataclass(frozen=True, eq=False)
class Linearised:
    """The model near a state.

    ``residual`` (3, N) is measured minus predicted, mm, tracker frame; ``whitened`` (3, N) the
    same in sigmas.
    """

    state: State
    residual: Array
    whitened: Array
    derivatives: Derivatives

    @property
    def jacobian(self) -> Array:
        """Whitened derivatives (p, 3, N) of the prediction by all unknowns."""
        return self.derivatives.value

    @property
    def situation(self) -> Situation:
        """Where the machine stood."""
        assert self.state.situation is not None
        return self.state.situation
