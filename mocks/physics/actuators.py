"""What actuators get wrong, whatever they move: what is hidden, and how the live machine settles.

"Extension" is added to what the actuator does; signs follow the catalogue of effects. Extensions
are in the actuator's unit, mm or rad.
"""

from dataclasses import dataclass, replace

import numpy as np

from mocks.hidden.effect import Physics
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array

CREEP_PER_STEP = 3e-4
CREEP_TAU_S = 0.4
RINGING = 0.03
RINGING_STEP = 5.0
RINGING_HZ = 9.0
RINGING_TAU_S = 0.25


@dataclass(frozen=True)
class Load:
    """Masses in kg; centres of mass in the platform frame, mm; gravity in m/s^2, base frame."""

    platform_mass_kg: float = 8.0
    platform_com: tuple[float, float, float] = (0.0, 0.0, 50.0)
    payload_com: tuple[float, float, float] = (0.0, 0.0, 90.0)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.80665)

    def wrench(self, rotation: Array, payload: Array) -> Array:
        """Weight (N) and its moment (N mm) about the platform's origin, base axes, (N, 6)."""
        gravity = np.asarray(self.gravity)
        weight = (self.platform_mass_kg + payload)[:, None] * gravity
        arm = self.platform_mass_kg * np.asarray(self.platform_com)
        arm = arm + payload[:, None] * np.asarray(self.payload_com)
        turned = np.einsum("nij,nj->ni", rotation, arm)
        return np.concatenate([weight, np.cross(turned, gravity)], axis=1)


def true_load(load: Load, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Load:
    """What is really carried where something hidden has moved it."""
    every = [physics.payload_off for physics in hidden.physics(limbs, stroke)]
    x, y, z = np.asarray(load.payload_com) + sum(
        (off for off in every if off is not None), np.zeros(3)
    )
    return replace(load, payload_com=(float(x), float(y), float(z)))


def play_widths(hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Array:
    """Full widths (n, K) of the play elements that the hidden effects need, one after the other."""
    return np.concatenate([np.zeros((len(limbs), 0)), *_widths(hidden, limbs, stroke)], axis=1)


def _widths(hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> list[Array]:
    """Widths (n, K) for each hidden effect, K = 0 where it needs none."""
    own = (effect.widths(hidden, limbs, stroke) for effect in hidden.effects)
    return [np.zeros((len(limbs), 0)) if one is None else one for one in own]


class ActuatorErrors:
    """The errors of all actuators for one set of hidden effects.

    Parameters
    ----------
    settles : bool
        Whether actuators creep and ring after each move, as the live machine does.
    """

    def __init__(
        self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke, settles: bool
    ) -> None:
        self._settles, self._stroke = settles, stroke
        self._hidden: list[tuple[Physics, slice]] = []
        first = 0
        for physics, widths in zip(
            hidden.physics(limbs, stroke), _widths(hidden, limbs, stroke), strict=True
        ):
            self._hidden.append((physics, slice(first, first + widths.shape[1])))
            first += widths.shape[1]

    def added(self, c: Circumstances) -> Array:
        """What is added to the extensions, (N, n)."""
        error = np.zeros(c.extension.shape)
        for physics, own in self._hidden:
            if physics.extension is not None:
                error = error + physics.extension(replace(c, play=c.play[:, :, own]))
        return np.asarray(error + self._after_move(c)) if self._settles else error

    @property
    def yields(self) -> bool:
        """Whether actuators give way under load."""
        return any(p.compliance is not None or p.friction is not None for p, _ in self._hidden)

    def softness(self, c: Circumstances) -> tuple[Array, Array]:
        """How each gives way to its load, and to the load's size, (N, n), mm/N or rad/(N mm)."""
        yields, lags = np.zeros(c.extension.shape), np.zeros(c.extension.shape)
        for physics, _ in self._hidden:
            if physics.compliance is not None:
                yields = yields + physics.compliance(c)
            if physics.friction is not None:
                lags = lags + physics.friction(c)
        return yields, lags

    def _after_move(self, c: Circumstances) -> Array:
        since, unit = np.maximum(c.delay, 0.0), self._stroke.per_mm
        creep = -CREEP_PER_STEP * c.step * np.exp(-since / CREEP_TAU_S)
        swing = np.tanh(c.step / (RINGING_STEP * unit)) * np.exp(-since / RINGING_TAU_S)
        return np.asarray(creep + RINGING * unit * swing * np.sin(2.0 * np.pi * RINGING_HZ * since))
