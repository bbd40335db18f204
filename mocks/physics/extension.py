"""How far each leg really extends: the hidden errors of the hexapod's actuators.

"Extension" is added to what the actuator does; signs follow the catalogue of effects.
"""

from dataclasses import dataclass

import numpy as np

from mocks.physics.hexapod import PHI_B_DEG, HexapodGeometry, Legs
from mocks.physics.hidden import Hidden
from mocks.physics.pose import Array, Pose

HYSTERESIS_WIDTHS_MM = (0.3, 2.0, 8.0)
REFERENCE_C = 20.0
HOME_LENGTH_MM = 230.715
DEFAULT_CYCLIC_PERIOD_MM = 4.0
CREEP_PER_STEP = 3e-4
CREEP_TAU_S = 0.4
RINGING_MM = 0.03
RINGING_HZ = 9.0
RINGING_TAU_S = 0.25


@dataclass(frozen=True)
class Load:
    """Masses in kg; centres of mass in the platform frame, mm; gravity in m/s^2, base frame."""

    platform_mass_kg: float = 8.0
    platform_com: tuple[float, float, float] = (0.0, 0.0, 50.0)
    payload_com: tuple[float, float, float] = (0.0, 0.0, 90.0)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.80665)


@dataclass(frozen=True)
class Circumstances:
    """What the legs' errors depend on, at N instants.

    ``extension`` s (N, 6) mm; ``play`` (N, 6, K) mm; ``step`` (N, 6) mm, the last move;
    ``delay`` (N, 6) s since it ended (negative while it lasts); temperatures (N,) deg C;
    ``payload`` (N,) kg.
    """

    extension: Array
    play: Array
    step: Array
    delay: Array
    structure: Array
    air: Array
    payload: Array


def play_widths(hidden: Hidden) -> Array:
    """Full widths (6, K) in mm: the backlash, then the memory of the hysteresis."""
    memory = np.tile(HYSTERESIS_WIDTHS_MM, (6, 1))
    return np.column_stack([np.abs(hidden.legs("backlash.*")), memory])


class LegErrors:
    """The errors of all six legs for one set of hidden effects.

    Parameters
    ----------
    hidden : Hidden
    load : Load
    settles : bool
        Whether legs creep and ring after each move, as the live machine does.
    """

    def __init__(self, hidden: Hidden, load: Load, settles: bool = True) -> None:
        self._load = load
        self._settles = settles
        self._gain = hidden.legs("screw-pitch.*")
        self._quadratic = hidden.legs("unknown.screw-quadratic.*")
        self._sin = hidden.legs("screw-cyclic.*.sin")
        self._cos = hidden.legs("screw-cyclic.*.cos")
        self._period = hidden.get("screw-cyclic.period", DEFAULT_CYCLIC_PERIOD_MM)
        # A negative backlash is not physical, but a file may ask for the mirrored sign.
        self._backlash_sign = np.where(hidden.legs("backlash.*") < 0.0, -1.0, 1.0)
        self._hysteresis = hidden.legs("unknown.hysteresis.*")
        self._creep = hidden.get("settling.k")
        self._creep_tau = hidden.get("settling.tau", 5.0)
        self._growth = hidden.get("thermal-growth.a")
        self._bending = hidden.get("unknown.bending.k")
        self._twist_lead = hidden.get("screw-twist.L")
        self._compliance = hidden.get("gravity-sag.c")
        self._softness = hidden.get("unknown.soft-legs.k")

    def fixed(self, c: Circumstances) -> Array:
        """The part that does not depend on the pose, (N, 6), mm."""
        s = c.extension
        turn = 2.0 * np.pi * s / self._period
        error = self._gain * s + self._quadratic * s**2
        error = error + self._sin * np.sin(turn) + self._cos * np.cos(turn)
        error = error + self._backlash_sign * c.play[:, :, 0]
        memory = c.play[:, :, 1:] / (0.5 * np.asarray(HYSTERESIS_WIDTHS_MM))
        error = error + self._hysteresis * memory.mean(axis=2)
        return np.asarray(error + self._after_move(c) + self._warmth(c))

    def _after_move(self, c: Circumstances) -> Array:
        since = np.maximum(c.delay, 0.0)
        error = self._creep * c.step * np.exp(-since / self._creep_tau)
        if self._settles:
            error = error - CREEP_PER_STEP * c.step * np.exp(-since / CREEP_TAU_S)
            swing = RINGING_MM * np.tanh(c.step / 5.0) * np.exp(-since / RINGING_TAU_S)
            error = error + swing * np.sin(2.0 * np.pi * RINGING_HZ * since)
        return np.asarray(error)

    def _warmth(self, c: Circumstances) -> Array:
        length = HOME_LENGTH_MM + c.extension
        growth = self._growth * (c.structure - REFERENCE_C)[:, None] * length
        sun = 1.0 + np.cos(np.radians(PHI_B_DEG))
        gradient = (c.structure - c.air)[:, None]
        return np.asarray(growth + self._bending * gradient * sun * (length / HOME_LENGTH_MM) ** 2)

    @property
    def depends_on_pose(self) -> bool:
        """Whether :meth:`with_pose` adds anything."""
        return bool(self._twist_lead or self._compliance or self._softness)

    def with_pose(self, c: Circumstances, legs: Legs, pose: Pose, home_twist: Array) -> Array:
        """The part that depends on the pose, (N, 6), mm."""
        error = np.zeros(c.extension.shape)
        if self._twist_lead:
            change = legs.twist() - home_twist
            change = (change + np.pi) % (2.0 * np.pi) - np.pi
            error += self._twist_lead / (2.0 * np.pi) * change
        if self._compliance or self._softness:
            force = axial_forces(legs, pose, self._load, c.payload)
            error += (self._compliance + self._softness * c.extension) * force
        return error


def axial_forces(legs: Legs, pose: Pose, load: Load, payload: Array) -> Array:
    """Axial force of each leg, (N, 6), N, + = tension, from the equilibrium of the platform.

    The legs pull the platform with -F_i u_i: sum F_i [u_i; arm_i x u_i] = weight and its moment.
    """
    gravity = np.asarray(load.gravity)
    weight = (load.platform_mass_kg + payload)[:, None] * gravity
    moment_arm = load.platform_mass_kg * np.asarray(load.platform_com) + payload[
        :, None
    ] * np.asarray(load.payload_com)
    turned = np.einsum("nij,nj->ni", pose.rotation, moment_arm)
    wrench = np.concatenate([weight, np.cross(turned, gravity)], axis=1)
    columns = legs.rows().transpose(0, 2, 1)
    return np.asarray(np.linalg.solve(columns, wrench[:, :, None])[:, :, 0])


def lengths(geometry: HexapodGeometry, extension: Array) -> Array:
    """Length of each leg without errors, (N, 6), mm."""
    return np.asarray(geometry.L0 + extension)
