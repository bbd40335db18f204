"""Units and coordinates in which the mock tracker speaks."""

from collections.abc import Mapping

import numpy as np

from drivers.emscon import wire
from drivers.emscon.codes import Angle, Coordinates, Pressure, Temperature
from mocks.physics.pose import Array

_PER_MM: dict[int, float] = {0: 1e-3, 1: 1.0, 2: 1e3, 3: 1 / 304.8, 4: 1 / 914.4, 5: 1 / 25.4}
"""m, mm, um, ft, yd, in."""
_PER_RAD: dict[int, float] = {
    Angle.RADIAN: 1.0,
    Angle.DEGREE: 180.0 / np.pi,
    Angle.GON: 200.0 / np.pi,
}
_PER_HPA: dict[int, float] = {Pressure.MBAR: 1.0, Pressure.HPA: 1.0, Pressure.KPA: 0.1}


class Units:
    """Conversions between mm, rad, deg C, hPa and what the client has asked for."""

    def __init__(self, values: Mapping[str, wire.Value], coordinates: int) -> None:
        length = int(values["length"])
        self._length = _PER_MM.get(length, 1e-3)
        self._angle = _PER_RAD.get(int(values["angle"]), 1.0)
        self._fahrenheit = values["temperature"] == int(Temperature.FAHRENHEIT)
        self._pressure = _PER_HPA.get(int(values["pressure"]), 1.0)
        self._spherical = coordinates == Coordinates.SPHERICAL_CCW

    def from_mm(self, value: float) -> float:
        """A length in the client's unit."""
        return value * self._length

    def to_mm(self, value: float) -> float:
        """A length of the client in mm."""
        return value / self._length

    def temperature(self, celsius: float) -> float:
        """A temperature in the client's unit."""
        return 1.8 * celsius + 32.0 if self._fahrenheit else celsius

    def meteo(self, air: tuple[float, float, float]) -> dict[str, wire.Value]:
        """Weather (deg C, hPa, %) in the client's units."""
        return {
            "temperature": self.temperature(air[0]),
            "pressure": air[1] * self._pressure,
            "humidity": air[2],
        }

    def environment(self, values: Mapping[str, wire.Value]) -> tuple[float, float, float]:
        """The client's weather as deg C, hPa, %."""
        given = float(values["temperature"])
        celsius = (given - 32.0) / 1.8 if self._fahrenheit else given
        return celsius, float(values["pressure"]) / self._pressure, float(values["humidity"])

    def point_mm(self, values: Mapping[str, wire.Value]) -> Array:
        """A point of the client as x, y, z in mm."""
        a, b, c = (float(values[name]) for name in ("x", "y", "z"))
        if not self._spherical:
            return np.array([a, b, c]) / self._length
        hz, zenith, distance = a / self._angle, b / self._angle, c / self._length
        return distance * np.array(
            [np.sin(zenith) * np.cos(hz), np.sin(zenith) * np.sin(hz), np.cos(zenith)]
        )

    def point(self, xyz: Array) -> Array:
        """A point (3,) in mm as the client's three numbers."""
        if not self._spherical:
            return np.asarray(xyz * self._length)
        hz, zenith = self.direction(xyz)
        return np.array([hz, zenith, float(np.linalg.norm(xyz)) * self._length])

    def direction(self, xyz: Array) -> tuple[float, float]:
        """Horizontal angle and zenith angle of a point in the client's unit."""
        hz = float(np.arctan2(xyz[1], xyz[0]))
        zenith = float(np.arccos(xyz[2] / np.linalg.norm(xyz)))
        return hz * self._angle, zenith * self._angle

    def covariance(self, xyz: Array, cov: Array) -> Array:
        """Covariance (3, 3) of a point, mm^2, in the client's units and coordinates."""
        if not self._spherical:
            return np.asarray(cov * self._length**2)
        x, y, z = xyz
        flat, distance = float(np.hypot(x, y)), float(np.linalg.norm(xyz))
        jacobian = np.array(
            [
                [-y / flat**2, x / flat**2, 0.0],
                [x * z / (flat * distance**2), y * z / (flat * distance**2), -flat / distance**2],
                [x / distance, y / distance, z / distance],
            ]
        )
        jacobian *= np.array([[self._angle], [self._angle], [self._length]])
        return np.asarray(jacobian @ cov @ jacobian.T)
