"""The tripod as a body of the mock world: three sliders, three parallelograms."""

from collections.abc import Mapping

import numpy as np

from mocks.hidden.table import Hidden
from mocks.physics.actuators import ActuatorErrors, Load
from mocks.physics.body import Place, Surroundings
from mocks.physics.circumstances import REFERENCE_C, SLIDE, Circumstances
from mocks.physics.parallelograms import settle, sides
from mocks.physics.pose import Array, Pose
from mocks.physics.tripod import HOME_Q, LIMBS, geometry, positions, slider_places
from mocks.physics.truth import machine_file

HOME_Z = -121.24355652982142
# The platform hangs below the sliders: the tracker looks at it from the side, between two rails.
AROUND = Surroundings(
    platform_nests={
        "p1": (120.0, 0.0, -60.0),
        "p2": (-60.0, 103.923048, -60.0),
        "p3": (-60.0, -103.923048, -60.0),
    },
    base_nests={
        "b1": (240.0, 415.692194, -40.0),
        "b2": (-480.0, 0.0, -40.0),
        "b3": (240.0, -415.692194, -40.0),
        "b4": (480.0, 120.0, 40.0),
    },
    place=Place(height=(120.0, 180.0), bearings=3, first_rad=float(np.pi / 3.0)),
    load=Load(
        platform_mass_kg=6.0, platform_com=(15.0, 0.0, -20.0), payload_com=(0.0, 25.0, -60.0)
    ),
)


class RealTripod:
    """One tripod: true parameters and hidden errors.

    The platform stays parallel unless something hidden turns it; then it rests on six elastic
    sides.
    """

    def __init__(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> None:
        self._geometry = geometry(parameters)
        self._actuators = ActuatorErrors(hidden, LIMBS, SLIDE, settles)
        self._own_growth = hidden.limbs("leg-warming.*", LIMBS)
        self._growth = hidden.get("thermal-growth.a")
        self._compliance = hidden.get("gravity-sag.c")
        self._difference = hidden.limbs("parallelogram-sides.*", LIMBS)
        self._azimuth = hidden.limbs("joint-azimuth.*", LIMBS)
        self._load = load

    def home(self, count: int) -> Pose:
        """``count`` copies of the nominal home pose."""
        position = np.tile([0.0, 0.0, HOME_Z], (count, 1))
        return Pose(position, np.tile(np.eye(3), (count, 1, 1)))

    def poses(self, c: Circumstances, start: Pose) -> Pose:
        """Poses at N instants; ``start`` is not needed, the closed form has one root below."""
        g = self._geometry
        warmth = (c.structure - REFERENCE_C)[:, None]
        places = c.extension + g.l0 + self._actuators.added(c) + self._own_growth * warmth
        h = g.h * (1.0 + self._growth * warmth)
        count = len(places)
        parallel = Pose(positions(g, places, h), np.tile(np.eye(3), (count, 1, 1)))
        if not (self._compliance or self._difference.any() or self._azimuth.any()):
            return parallel
        wrench = self._load.wrench(parallel.rotation, c.payload)
        six = sides(g, places, h, self._difference, self._azimuth)
        return settle(six, parallel, self._compliance, wrench)


class TripodBody:
    """Three sliders and three parallelograms (Feng et al. 2022)."""

    kind = "tripod"

    def __init__(self) -> None:
        self.machine = machine_file("tripod")
        self.limbs = LIMBS
        self.stroke = SLIDE
        self.around = AROUND

    def reference(self, held: Mapping[str, float]) -> Array:
        """q = 410 wherever the sliders really stand then, (3,), mm."""
        return np.full(3, HOME_Q)

    def commanded(self, held: Mapping[str, float], poses: Array) -> Array:
        """q (N, 3) for poses x, y, z (N, 3) in mm: a slider stands at q + l0 - 410."""
        g = geometry(held)
        return slider_places(g, poses) - g.l0 + HOME_Q

    def real(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> RealTripod:
        """A tripod with these true parameters."""
        hidden.check("tripod", LIMBS)
        return RealTripod(parameters, hidden, load, settles)
