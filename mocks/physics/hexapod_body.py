"""The hexapod as a body of the mock world: closed-form legs with their hidden errors."""

from collections.abc import Mapping

import numpy as np

from mocks.hidden.table import Hidden
from mocks.physics.actuators import Load
from mocks.physics.body import Place, Surroundings, TrueMachine
from mocks.physics.circumstances import MILLIMETRES, Circumstances
from mocks.physics.hexapod import (
    HexapodGeometry,
    Legs,
    forward,
    geometry,
    home_pose,
    legs,
)
from mocks.physics.hexapod_legs import LIMBS, LegErrors, lengths
from mocks.physics.pose import Array, Pose, rotations_from_rpy
from mocks.physics.truth import machine_file

AROUND = Surroundings(
    platform_nests={
        "3": (0.0, 100.0, 0.0),
        "4": (-86.602540, -50.0, 0.0),
        "5": (86.602540, -50.0, 0.0),
    },
    base_nests={
        "b1": (260.0, 0.0, -30.0),
        "b2": (0.0, 260.0, -30.0),
        "b3": (-260.0, 0.0, -30.0),
        "b4": (0.0, -260.0, -30.0),
    },
    place=Place(height=(-450.0, -390.0)),
)


class RealHexapod:
    """One hexapod: true geometry and hidden errors."""

    def __init__(self, g: HexapodGeometry, errors: LegErrors) -> None:
        self._geometry, self._errors = g, errors
        self._home_twist = home_twist(g)

    def home(self, count: int) -> Pose:
        """``count`` copies of the nominal home pose."""
        return home_pose(count)

    def poses(self, c: Circumstances, start: Pose) -> Pose:
        """Poses at N instants from what the legs do, hidden errors included."""
        fixed = lengths(self._geometry, c.extension) + self._errors.fixed(c)

        def wanted(found: Legs, pose: Pose) -> Array:
            if not self._errors.depends_on_pose:
                return fixed
            return fixed + self._errors.with_pose(c, found, pose, self._home_twist)

        return forward(self._geometry, wanted, start)[0]


class HexapodBody:
    """Six legs between offset universal joints (Han et al. 2020)."""

    kind = "hexapod"

    def __init__(self) -> None:
        self.machine = machine_file("hexapod")
        self.limbs = LIMBS
        self.stroke = MILLIMETRES
        self.around = AROUND

    def reference(self, held: Mapping[str, float]) -> Array:
        """The leg lengths L0 that the controller holds, (6,), mm."""
        return np.array([held[f"{leg}.L0"] for leg in LIMBS])

    def commanded(self, held: Mapping[str, float], poses: Array) -> Array:
        """Leg lengths at poses (N, 6): x, y, z in mm, rx, ry, rz in rad."""
        pose = Pose(np.asarray(poses[:, :3], dtype=float), rotations_from_rpy(poses[:, 3:]))
        return legs(geometry(held), pose).length

    def real(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> TrueMachine:
        """A hexapod with these true parameters."""
        hidden.check("hexapod", LIMBS)
        return RealHexapod(true_geometry(parameters, hidden), LegErrors(hidden, load, settles))


def true_geometry(parameters: Mapping[str, float], hidden: Hidden) -> HexapodGeometry:
    """Geometry with the hidden tilts of the joints' first axes."""

    def tilt(body: str) -> Array:
        angles = [hidden.limbs(f"joint-tilt.*.{body}.{axis}", LIMBS) for axis in "yz"]
        return np.stack(angles, axis=1)

    return geometry(parameters, tilt("base"), tilt("platform"))


def home_twist(g: HexapodGeometry) -> Array:
    """Twist of each leg at zero extension, (6,), rad."""
    _, found = forward(g, lambda legs, pose: g.L0[None, :], home_pose(1))
    return np.asarray(found.twist()[0])
