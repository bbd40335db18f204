"""What a total station does: turns, aims at a prism, measures a distance; one procedure a method.

Written from Leica's description of GeoCOM; it shares nothing with the driver. Its readings are
those of the mock's tracker with the noise of a total station on top.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from mocks.clock import ScaledClock
from mocks.smrs import HAND
from mocks.tracker.sensor import Sensor
from mocks.world import World

NAME, SERIAL, FIRMWARE = "MS60", 370_042, (8, 20, 91)
FIELD = math.radians(0.75)
"""Half angle within which target recognition finds a prism."""
EDM_S, TURN_S = 1.5, 2.0
ANGLE_NOISE, DISTANCE_NOISE_MM = math.radians(0.5 / 3600.0), 0.25
OK, ABORT, ANGLE_OK, DIST_ERROR, NO_TARGET = 0, 8, 1285, 1292, 8710
PRISM_TYPES = (0, 1, 2, 3, 7, 8)
Reply = tuple[int, tuple[str, ...]]


class TotalStationMock:
    """State of the instrument; ``wait`` lets machine time pass before an answer (s)."""

    def __init__(self, world: World, clock: ScaledClock) -> None:
        self._world, self._clock = world, clock
        self._sensor = Sensor(world)
        self._rng = np.random.default_rng([world.plan.seed, 60])
        self.horizontal, self.vertical, self.face = 0.0, 0.5 * math.pi, 1
        self.recognises = False
        self.prism = 0
        self._started: float | None = None
        self.procedures: dict[int, Callable[[Sequence[float]], tuple[float, Reply]]] = {
            0: lambda values: (0.0, (OK, ())),
            2008: self._do_measure,
            2026: lambda values: (0.0, (OK, (str(self.face - 1),))),
            2108: self._simple_measurement,
            5003: lambda values: (0.0, (OK, (str(SERIAL),))),
            5004: lambda values: (0.0, (OK, (f'"{NAME}"',))),
            5034: lambda values: (0.0, (OK, tuple(map(str, FIRMWARE)))),
            6002: self._stop,
            9027: self._turn,
            9028: self._change_face,
            9029: self._search,
            9037: self._search,
            17008: self._set_prism,
            17009: lambda values: (0.0, (OK, (str(self.prism),))),
            18005: self._recognition,
            18006: lambda values: (0.0, (OK, (str(int(self.recognises)),))),
        }

    def _recognition(self, values: Sequence[float]) -> tuple[float, Reply]:
        self.recognises = bool(values[0])
        return 0.0, (OK, ())

    def _set_prism(self, values: Sequence[float]) -> tuple[float, Reply]:
        if int(values[0]) not in PRISM_TYPES:
            return 0.0, (2, ())
        self.prism = int(values[0])
        return 0.0, (OK, ())

    def _stop(self, values: Sequence[float]) -> tuple[float, Reply]:
        return 0.0, (OK, ())

    def _turn(self, values: Sequence[float]) -> tuple[float, Reply]:
        self.horizontal, self.vertical = values[0] % (2.0 * math.pi), values[1]
        self.face = 1 if self.vertical <= math.pi else 2
        self._started = None
        return TURN_S, (self._aim() if values[3] else OK, ())

    def _change_face(self, values: Sequence[float]) -> tuple[float, Reply]:
        self.horizontal = (self.horizontal + math.pi) % (2.0 * math.pi)
        self.vertical = 2.0 * math.pi - self.vertical
        self.face = 3 - self.face
        self._started = None
        return TURN_S, (self._aim() if values[1] else OK, ())

    def _search(self, values: Sequence[float]) -> tuple[float, Reply]:
        return TURN_S, (self._aim(FIELD + max(values[0], values[1])), ())

    def _do_measure(self, values: Sequence[float]) -> tuple[float, Reply]:
        program = int(values[0])
        self._started = self._clock.now() if program == 1 else None
        return 0.0, (OK, ())

    def _simple_measurement(self, values: Sequence[float]) -> tuple[float, Reply]:
        if self._started is None:
            return 0.0, (ANGLE_OK, (*self._angles(), "0"))
        left = self._started + EDM_S - self._clock.now()
        if left > 1e-3 * values[0]:
            return 1e-3 * values[0], (ANGLE_OK, (*self._angles(), "0"))
        if self.recognises and self._aim() != OK:
            return max(left, 0.0), (DIST_ERROR, (*self._angles(), "0"))
        point = self._seen(FIELD if self.recognises else math.radians(0.02))
        if point is None:
            return max(left, 0.0), (DIST_ERROR, (*self._angles(), "0"))
        reach = float(np.linalg.norm(point)) + DISTANCE_NOISE_MM * self._rng.standard_normal()
        return max(left, 0.0), (OK, (*self._angles(), f"{1e-3 * reach:.15g}"))

    def _angles(self) -> tuple[str, str]:
        noise = ANGLE_NOISE * self._rng.standard_normal(2)
        wide = math.sin(self.vertical)
        return (
            f"{(self.horizontal + noise[0] / wide) % (2.0 * math.pi):.15g}",
            f"{self.vertical + noise[1]:.15g}",
        )

    def _aim(self, field: float = FIELD) -> int:
        """Turn onto the prism next to the line of sight; a return code."""
        point = self._seen(field)
        if point is None:
            return NO_TARGET
        x, y, z = point
        horizontal, vertical = math.atan2(x, y), math.acos(z / float(np.linalg.norm(point)))
        if self.face == 2:
            horizontal, vertical = horizontal + math.pi, 2.0 * math.pi - vertical
        self.horizontal, self.vertical = horizontal % (2.0 * math.pi), vertical
        return OK

    def _seen(self, field: float) -> "np.ndarray | None":
        """Where the prism nearest to the line of sight is read, mm; None where none is near."""
        if "tracker-lost" in self._world.faults:
            return None
        level = math.sin(self.vertical)
        sight = np.array(
            [level * math.sin(self.horizontal), level * math.cos(self.horizontal),
             math.cos(self.vertical)]
        )  # fmt: skip
        now, found = np.array([self._clock.now()]), []
        for smr, place in self._world.smrs.places.items():
            if place == HAND:
                continue
            point = self._sensor.samples(smr, now)[0]
            away = math.acos(float(np.clip(sight @ point / np.linalg.norm(point), -1.0, 1.0)))
            found.append((away, tuple(point)))
        nearest = min(found, default=None)
        return None if nearest is None or nearest[0] > field else np.array(nearest[1])
