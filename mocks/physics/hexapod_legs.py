"""How far each leg really extends: the hidden errors of the hexapod's actuators.

"Extension" is added to what the actuator does; signs follow the catalogue of effects.
"""

import numpy as np

from mocks.hidden.table import Hidden
from mocks.physics.actuators import ActuatorErrors, Load
from mocks.physics.circumstances import MILLIMETRES, REFERENCE_C, Circumstances
from mocks.physics.hexapod import PHI_B_DEG, HexapodGeometry, Legs
from mocks.physics.pose import Array, Pose

LIMBS = tuple(f"leg{n}" for n in range(1, 7))
HOME_LENGTH_MM = 230.715


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
        self._actuators = ActuatorErrors(hidden, LIMBS, MILLIMETRES, settles)
        self._growth = hidden.get("thermal-growth.a")
        self._own_growth = hidden.limbs("leg-warming.*", LIMBS)
        self._bending = hidden.get("unknown.bending.k")
        self._twist_lead = hidden.get("screw-twist.L")

    def fixed(self, c: Circumstances) -> Array:
        """The part that does not depend on the pose, (N, 6), mm."""
        return np.asarray(self._actuators.added(c) + self._warmth(c))

    def _warmth(self, c: Circumstances) -> Array:
        length = HOME_LENGTH_MM + c.extension
        each = self._growth + self._own_growth / HOME_LENGTH_MM
        growth = each * (c.structure - REFERENCE_C)[:, None] * length
        sun = 1.0 + np.cos(np.radians(PHI_B_DEG))
        gradient = (c.structure - c.air)[:, None]
        return np.asarray(growth + self._bending * gradient * sun * (length / HOME_LENGTH_MM) ** 2)

    @property
    def depends_on_pose(self) -> bool:
        """Whether :meth:`with_pose` adds anything."""
        return bool(self._twist_lead) or self._actuators.yields

    def with_pose(self, c: Circumstances, legs: Legs, pose: Pose, home_twist: Array) -> Array:
        """The part that depends on the pose, (N, 6), mm."""
        error = np.zeros(c.extension.shape)
        if self._twist_lead:
            change = legs.twist() - home_twist
            change = (change + np.pi) % (2.0 * np.pi) - np.pi
            error += self._twist_lead / (2.0 * np.pi) * change
        if self._actuators.yields:
            force = axial_forces(legs, pose, self._load, c.payload)
            yields, lags = self._actuators.softness(c)
            error += yields * force + lags * np.abs(force)
        return error


def axial_forces(legs: Legs, pose: Pose, load: Load, payload: Array) -> Array:
    """Axial force of each leg, (N, 6), N, + = tension, from the equilibrium of the platform.

    The legs pull the platform with -F_i u_i: sum F_i [u_i; arm_i x u_i] = weight and its moment.
    """
    wrench = load.wrench(pose.rotation, payload)
    columns = legs.rows().transpose(0, 2, 1)
    return np.asarray(np.linalg.solve(columns, wrench[:, :, None])[:, :, 0])


def lengths(geometry: HexapodGeometry, extension: Array) -> Array:
    """Length of each leg without errors, (N, 6), mm."""
    return np.asarray(geometry.L0 + extension)
