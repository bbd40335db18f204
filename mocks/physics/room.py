"""Where the tracker stands, where the nests are, and what distorts a point on its way."""

import numpy as np

from mocks.hidden.effect import Nest
from mocks.hidden.table import Hidden
from mocks.physics.body import Body, Place
from mocks.physics.pose import Array, rotation_from_rpy, rpy_from_rotation

HOME_REFLECTOR = (0.0, 180.0, -60.0)
"""Birdbath, tracker frame, mm."""
CLEAR_MM, TURN_RAD = 20.0, float(np.pi / 6.0)
"""How far a line of sight passes the birdbath, as an SMR in it is 19 mm thick and is searched for
within 20; by how much the tracker is turned on its stand until it does."""

BEARING_SPREAD_RAD = float(np.radians(6.0))


class Station:
    """The base frame in the tracker frame: p_tracker = R p_base + t, drawn by ``seed``.

    The tracker stands 1.2 to 1.4 m away, at a height that suits the machine, levelled to some
    milliradians. It is put where an operator would put it: between two nests of the platform, so
    that no SMR hides another within the 20 deg by which a hexapod's platform turns, and turned on
    its stand so that its own birdbath hides none of the points ``seen`` (N, 3), base frame, mm.
    """

    def __init__(self, seed: int, place: Place, seen: Array | None = None) -> None:
        rng = np.random.default_rng([seed, 2])
        every = 2.0 * np.pi / place.bearings
        side = rng.integers(place.bearings) * every + place.first_rad
        bearing = side + rng.uniform(-1.0, 1.0) * BEARING_SPREAD_RAD
        yaw = rng.uniform(-np.pi, np.pi)
        azimuth = bearing + yaw + np.pi
        distance = rng.uniform(1220.0, 1330.0)
        height = rng.uniform(*place.height)
        self.translation = np.array(
            [distance * np.cos(azimuth), distance * np.sin(azimuth), height]
        )
        rx, ry = rng.normal(0.0, 0.004, 2)
        self.rotation = rotation_from_rpy(rx, ry, yaw)
        turn = rotation_from_rpy(0.0, 0.0, TURN_RAD)
        while seen is not None and self._passes_birdbath_mm(seen) < CLEAR_MM:
            self.rotation, self.translation = turn @ self.rotation, turn @ self.translation

    def _passes_birdbath_mm(self, seen: Array) -> float:
        """Least distance of the birdbath from the lines of sight to points (N, 3), base frame."""
        sights, bath = self.to_tracker(seen), np.array(HOME_REFLECTOR)
        sights /= np.linalg.norm(sights, axis=1, keepdims=True)
        along = np.maximum(sights @ bath, 0.0)[:, None]
        return float(np.linalg.norm(bath - along * sights, axis=1).min())

    def frame(self) -> list[float]:
        """x, y, z (mm), rx, ry, rz (rad) of the base frame in the tracker frame."""
        return [*self.translation.tolist(), *rpy_from_rotation(self.rotation[None])[0].tolist()]

    def to_tracker(self, base: Array) -> Array:
        """Points (N, 3) of the base frame in the tracker frame, mm."""
        return np.asarray(base @ self.rotation.T + self.translation)


class Distortions:
    """What the tracker gets wrong, systematically, and what shifts between the frames.

    Displacements are those of the undistorted point; several add up.
    """

    def __init__(self, hidden: Hidden, body: Body) -> None:
        self._on_platform = frozenset(body.around.platform_nests)
        every = hidden.physics(body.limbs, body.stroke)
        self._nest = [one.nest for one in every if one.nest is not None]
        self._base = [one.base for one in every if one.base is not None]
        self._seen = [one.seen for one in every if one.seen is not None]

    def nest(self, name: str, centre: Array, times: Array, down: Array) -> Array:
        """SMR centres (N, 3) in the frame that carries the nest, mm.

        ``down`` (N, 3) is the direction of gravity in that frame.
        """
        where = Nest(name, np.asarray(centre), name in self._on_platform)
        points = centre + np.zeros((times.size, 3))
        for moved in self._nest:
            points = points + moved(where, times, down)
        return np.asarray(points)

    def base(self, points: Array, times: Array) -> Array:
        """Points (N, 3) of the base frame after the base has shifted, mm."""
        return np.asarray(points + sum(moved(points, times) for moved in self._base))

    def seen(self, points: Array, times: Array, span_s: float | None = None) -> Array:
        """What a noise-free tracker reads for points (N, 3) of its frame, mm.

        ``span_s``: how long the campaign lasts, s, where that is known.
        """
        return np.asarray(points + sum(moved(points, times, span_s) for moved in self._seen))
