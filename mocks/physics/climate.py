"""Temperatures, pressure and humidity of the room and of the machine's structure."""

import numpy as np

from mocks.physics.signals import Array, Steps, Wander

WANDER_TAU_S = 120.0


class Climate:
    """The structure warms up after switching on; the air follows the day.

    ``seed`` draws the start, the rise and its time constant. All at machine times (N,).
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 3])
        self._start = 20.0 + rng.uniform(-0.5, 0.5)
        self._rise = rng.uniform(1.5, 3.0)
        self._tau = rng.uniform(900.0, 2400.0)
        self._air = 20.5 + rng.uniform(-0.5, 0.5)
        self._air_slope = rng.uniform(-0.3, 0.6) / 3600.0
        self._pressure = 1013.25 + rng.uniform(-12.0, 12.0)
        self._humidity = rng.uniform(35.0, 55.0)
        self._wander = Wander(rng, WANDER_TAU_S, 3, terms=32)
        self._offset = Steps(np.zeros(()))

    def structure(self, times: Array) -> Array:
        """Temperature of the structure, deg C, (N,)."""
        warm = self._rise * (1.0 - np.exp(-np.maximum(times, 0.0) / self._tau))
        wander = 0.02 * self._wander.at(times)[0]
        return np.asarray(self._start + warm + wander + self._offset.at(times))

    def air(self, times: Array) -> Array:
        """Temperature of the air, deg C, (N,)."""
        drift = self._air + self._air_slope * np.clip(times, 0.0, 8 * 3600.0)
        return np.asarray(drift + 0.05 * self._wander.at(times)[1] + 0.3 * self._offset.at(times))

    def pressure(self, times: Array) -> Array:
        """Pressure of the air, hPa, (N,)."""
        return np.asarray(self._pressure + 0.1 * self._wander.at(times)[2])

    @property
    def humidity(self) -> float:
        """Relative humidity, %."""
        return self._humidity

    def set_structure(self, time: float, temperature_C: float) -> None:
        """Heat or cool the structure to ``temperature_C`` at ``time``; it drifts on from there."""
        now = float(self.structure(np.array([time]))[0])
        self._offset.set(time, np.asarray(self._offset.last + temperature_C - now))
