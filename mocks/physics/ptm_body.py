"""The tracking mechanism as a body of the mock world: two motors, five limbs."""

from collections.abc import Callable, Mapping

import numpy as np

from mocks.hidden.table import Hidden
from mocks.physics.actuators import ActuatorErrors, Load
from mocks.physics.body import Place, Surroundings
from mocks.physics.circumstances import RADIANS, REFERENCE_C, Circumstances
from mocks.physics.pose import Array, Pose
from mocks.physics.ptm import LIMBS, PtmGeometry, geometry
from mocks.physics.ptm_closure import Stance, at_home, close
from mocks.physics.ptm_mirror import base_angles, normals, stance
from mocks.physics.truth import machine_file

EQUAL = np.ones(4)
POINTED_RAD = 1e-11
MOST_STEPS = 12
AROUND = Surroundings(
    platform_nests={
        "p1": (110.0, 0.0, 25.0),
        "p2": (-55.0, 95.262794, 25.0),
        "p3": (-55.0, -95.262794, 25.0),
    },
    base_nests={
        "b1": (230.0, 230.0, -30.0),
        "b2": (-230.0, 230.0, -30.0),
        "b3": (-230.0, -230.0, -30.0),
        "b4": (230.0, -230.0, -30.0),
    },
    place=Place(height=(-560.0, -500.0)),
    load=Load(platform_mass_kg=6.0, platform_com=(0.0, 0.0, 30.0), payload_com=(20.0, 0.0, 80.0)),
)


class RealPtm:
    """One tracking mechanism: true errors and hidden ones."""

    def __init__(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> None:
        self._geometry = geometry(parameters)
        self._actuators = ActuatorErrors(hidden, LIMBS, RADIANS, settles)
        self._own_growth = hidden.limbs("leg-warming.*", LIMBS)
        self._growth = hidden.get("thermal-growth.a")
        self._load = load
        self._stiffness = EQUAL.copy()
        if hidden.has("redundancy."):
            limb = int(hidden.get("redundancy.limb"))
            if not 1 <= limb <= self._stiffness.size:
                raise ValueError("redundancy.limb must be 1, 2, 3 or 4")
            share = hidden.get("redundancy.share", 1.0)
            self._stiffness[limb - 1] = float(np.clip(1.0 - share, 0.0, 1.0))

    def home(self, count: int) -> Pose:
        """``count`` copies of the nominal home pose."""
        return at_home(count).pose

    def poses(self, c: Circumstances, start: Pose) -> Pose:
        """Poses at N instants; they start from the closed form of a machine without errors."""
        warmth = c.structure - REFERENCE_C
        angles = c.extension + self._actuators.added(c) + warmth[:, None] * self._own_growth
        grown = 1.0 + self._growth * warmth
        # Many instants share a state: the same pose read at several nests is closed once.
        states, which = np.unique(
            np.column_stack([angles, *self._actuators.softness(c), grown, c.payload]),
            axis=0,
            return_inverse=True,
        )
        pose = self._closed(states[:, :2], states[:, 2:6], states[:, 6], states[:, 7])
        return Pose(pose.position[which], pose.rotation[which])

    def _closed(self, angles: Array, softness: Array, grown: Array, payload: Array) -> Pose:
        yields, lags = softness[:, :2], softness[:, 2:]

        def motors(pose: Pose, by_motor: Array) -> Array:
            if not self._actuators.yields:
                return angles
            wrench = self._load.wrench(pose.rotation, payload)
            torque = np.einsum("nij,ni->nj", by_motor, wrench)
            return np.asarray(angles + yields * torque + lags * np.abs(torque))

        return close(self._geometry, motors, grown, self._stiffness, stance(angles)).pose


class PtmBody:
    """Two motors, four RSR limbs and one SS limb (Zhang et al. 2018)."""

    kind = "ptm"

    def __init__(self) -> None:
        self.machine = machine_file("ptm")
        self.limbs = LIMBS
        self.stroke = RADIANS
        self.around = AROUND

    def reference(self, held: Mapping[str, float]) -> Array:
        """Home is q = 0, (2,)."""
        return np.zeros(2)

    def commanded(self, held: Mapping[str, float], poses: Array) -> Array:
        """q (N, 2) that point the platform's z axis to tilt and azimuth (N, 2)."""
        q = base_angles(normals(poses[:, 0], poses[:, 1]))[:, :2]
        if any(held.values()):
            there = np.isfinite(q).all(axis=1)
            q[there] = pointed(geometry(held), poses[there], q[there])
        return q

    def real(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> RealPtm:
        """A tracking mechanism with these true errors."""
        hidden.check("ptm", LIMBS)
        return RealPtm(parameters, hidden, load, settles)


def _held_at(q: Array) -> Callable[[Pose, Array], Array]:
    """Motors that stand at ``q`` whatever they carry."""
    return lambda pose, by_motor: q


def pointed(g: PtmGeometry, poses: Array, q: Array) -> Array:
    """Motor angles (N, 2) that point exactly to tilt and azimuth (N, 2), from nearby ``q``.

    Newton on the x and y components of the platform's z axis; raises ArithmeticError if it does
    not close.
    """
    if not len(q):
        return q
    flat = np.sin(poses[:, 0])
    wanted = np.stack([flat * np.cos(poses[:, 1]), flat * np.sin(poses[:, 1])], axis=1)
    grown = np.ones(len(q))
    now: Stance = stance(q)
    for _ in range(MOST_STEPS):
        now = close(g, _held_at(q), grown, EQUAL, now)
        axis = now.pose.rotation[:, :, 2]
        off = wanted - axis[:, :2]
        if float(np.max(np.abs(off))) < POINTED_RAD:
            return q
        swing = np.cross(now.by_motor[:, 3:].transpose(0, 2, 1), axis[:, None])[:, :, :2]
        q = q + np.linalg.solve(swing.transpose(0, 2, 1), off[:, :, None])[:, :, 0]
    raise ArithmeticError(f"the platform does not point: {np.max(np.abs(off)):.3g} rad are left")
