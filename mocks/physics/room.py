"""Where the tracker stands, where the nests are, and what distorts a point on its way."""

import numpy as np

from mocks.physics.body import Place, Surroundings
from mocks.physics.hidden import Hidden
from mocks.physics.pose import Array, rotation_from_rpy, rotation_from_vector, rpy_from_rotation

HOME_REFLECTOR = (0.0, 180.0, -60.0)
"""Birdbath, tracker frame, mm."""

DEFAULT_DRIFT_DURATION_S = 3600.0
BEARING_SPREAD_RAD = float(np.radians(6.0))


class Station:
    """The base frame in the tracker frame: p_tracker = R p_base + t, drawn by ``seed``.

    The tracker stands 1.2 to 1.4 m away, at a height that suits the machine, levelled to some
    milliradians. It is put where an operator would put it: between two nests of the platform, so
    that no SMR hides another within the 20 deg by which a hexapod's platform turns.
    """

    def __init__(self, seed: int, place: Place) -> None:
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

    def frame(self) -> list[float]:
        """x, y, z (mm), rx, ry, rz (rad) of the base frame in the tracker frame."""
        return [*self.translation.tolist(), *rpy_from_rotation(self.rotation[None])[0].tolist()]

    def to_tracker(self, base: Array) -> Array:
        """Points (N, 3) of the base frame in the tracker frame, mm."""
        return np.asarray(base @ self.rotation.T + self.translation)


class Distortions:
    """What the tracker gets wrong, systematically, and what shifts between the frames."""

    def __init__(self, hidden: Hidden, around: Surroundings) -> None:
        self._on_platform = frozenset(around.platform_nests)
        self._scale = hidden.get("tracker-scale.k")
        self._zero = hidden.get("tracker-offset.r0")
        self._v = np.array([hidden.get(f"tracker-drift.v{a}") for a in "xyz"])
        self._w = np.array([hidden.get(f"tracker-drift.w{a}") for a in "xyz"])
        self._drift_s = hidden.get("tracker-drift.duration", DEFAULT_DRIFT_DURATION_S)
        self._tide = hidden.get("unknown.tide.amplitude")
        self._tide_s = hidden.get("unknown.tide.period", 240.0)
        self._wobble = hidden.get("unknown.wobble.amplitude")
        self._wobble_rad = np.radians(hidden.get("unknown.wobble.period", 7.0))
        self._shift_time = hidden.get("frame-shift.t0", np.inf)
        shift = hidden.vector("frame-shift", "x y z rx ry rz")
        of_base = hidden.get("frame-shift.where") > 0.5
        self._shift_base: Array = shift if of_base else np.zeros(6)
        self._shift_platform: Array = np.zeros(6) if of_base else shift
        self._flex = hidden.get("unknown.platform-flex.k")
        nests = (*around.platform_nests, *around.base_nests)
        self._nests = {nest: hidden.vector(f"nest-offset.{nest}") for nest in nests}

    def nest(self, name: str, centre: Array, times: Array, down: Array) -> Array:
        """SMR centres (N, 3) in the frame that carries the nest, mm.

        ``down`` (N, 3) is the direction of gravity in that frame.
        """
        points = centre + self._nests.get(name, np.zeros(3)) + np.zeros((times.size, 3))
        if name in self._on_platform:
            points = points + self._flex * down * [1.0, 1.0, 0.0]
            points = self._after(times, points, self._shift_platform)
        return np.asarray(points)

    def base(self, points: Array, times: Array) -> Array:
        """Points (N, 3) of the base frame after the base has shifted, mm."""
        return self._after(times, points, self._shift_base)

    def _after(self, times: Array, points: Array, shift: Array) -> Array:
        if not shift.any():
            return points
        moved = points @ rotation_from_vector(shift[None, 3:])[0].T + shift[:3]
        return np.asarray(np.where((times >= self._shift_time)[:, None], moved, points))

    def seen(self, points: Array, times: Array, drift_s: float | None = None) -> Array:
        """What a noise-free tracker reads for points (N, 3) of its frame, mm."""
        radius = np.linalg.norm(points, axis=1, keepdims=True)
        seen = (1.0 + self._scale) * points + self._zero * points / radius
        u = np.clip(times / (drift_s or self._drift_s), 0.0, 1.0)[:, None]
        seen = seen + u * (self._v + np.cross(np.broadcast_to(self._w, points.shape), points))
        heave = self._tide * np.sin(2.0 * np.pi * times / self._tide_s)
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        heave = heave + self._wobble * np.sin(2.0 * np.pi * azimuth / self._wobble_rad)
        seen[:, 2] += heave
        return np.asarray(seen)
