"""What every actuator gets wrong, whatever it moves: gain, cycle, lost motion, creep.

"Extension" is added to what the actuator does; signs follow the catalogue of effects. Extensions
are in the actuator's unit, mm or rad.
"""

from dataclasses import dataclass

import numpy as np

from mocks.physics.hidden import Hidden
from mocks.physics.pose import Array

REFERENCE_C = 20.0
HYSTERESIS_WIDTHS = (0.3, 2.0, 8.0)
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


@dataclass(frozen=True)
class Stroke:
    """How large things are in an actuator's unit.

    ``per_mm``: what moves the machine as 1 mm of a leg does; ``cycle``: period of the cyclic
    error where none is given; ``speed``: per s; ``counts``: the drive's counts in a unit;
    ``digits``: decimals of q in a file; ``smallest``: change that reverses an actuator.
    """

    per_mm: float = 1.0
    cycle: float = 4.0
    speed: float = 20.0
    counts: float = 1e6
    digits: int = 6
    smallest: float = 1e-4


MILLIMETRES = Stroke()
RADIANS = Stroke(1.0 / 317.0, 2.0 * np.pi, 0.2, 1e9, 9, 1e-6)


@dataclass(frozen=True)
class Circumstances:
    """What the actuators' errors depend on, at N instants.

    ``extension`` s (N, n) as the encoders read it; ``play`` (N, n, K); ``step`` (N, n), the last
    move; ``delay`` (N, n) s since it ended (negative while it lasts); temperatures (N,) deg C;
    ``payload`` (N,) kg.
    """

    extension: Array
    play: Array
    step: Array
    delay: Array
    structure: Array
    air: Array
    payload: Array


def play_widths(hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Array:
    """Full widths (n, K): the backlash, then the memory of the hysteresis."""
    memory = np.tile(np.asarray(HYSTERESIS_WIDTHS) * stroke.per_mm, (len(limbs), 1))
    return np.column_stack([np.abs(hidden.limbs("backlash.*", limbs)), memory])


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
        self._gain = hidden.limbs("screw-pitch.*", limbs)
        self._quadratic = hidden.limbs("unknown.screw-quadratic.*", limbs)
        self._sin = hidden.limbs("screw-cyclic.*.sin", limbs)
        self._cos = hidden.limbs("screw-cyclic.*.cos", limbs)
        self._period = hidden.get("screw-cyclic.period", stroke.cycle)
        # A negative backlash is not physical, but a file may ask for the mirrored sign.
        self._backlash_sign = np.where(hidden.limbs("backlash.*", limbs) < 0.0, -1.0, 1.0)
        self._hysteresis = hidden.limbs("unknown.hysteresis.*", limbs)
        self._creep = hidden.get("settling.k")
        self._creep_tau = hidden.get("settling.tau", 5.0)

    def added(self, c: Circumstances) -> Array:
        """What is added to the extensions, (N, n)."""
        s = c.extension
        turn = 2.0 * np.pi * s / self._period
        error = self._gain * s + self._quadratic * s**2
        error = error + self._sin * np.sin(turn) + self._cos * np.cos(turn)
        error = error + self._backlash_sign * c.play[:, :, 0]
        widths = np.asarray(HYSTERESIS_WIDTHS) * self._stroke.per_mm
        error = error + self._hysteresis * (c.play[:, :, 1:] / (0.5 * widths)).mean(axis=2)
        return np.asarray(error + self._after_move(c))

    def _after_move(self, c: Circumstances) -> Array:
        since = np.maximum(c.delay, 0.0)
        error = self._creep * c.step * np.exp(-since / self._creep_tau)
        if self._settles:
            unit = self._stroke.per_mm
            error = error - CREEP_PER_STEP * c.step * np.exp(-since / CREEP_TAU_S)
            swing = np.tanh(c.step / (RINGING_STEP * unit)) * np.exp(-since / RINGING_TAU_S)
            error = error + RINGING * unit * swing * np.sin(2.0 * np.pi * RINGING_HZ * since)
        return np.asarray(error)
