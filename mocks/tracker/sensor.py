"""What a tracker reads for a point: noise with a radial and an angular part, refraction, faces."""

from dataclasses import dataclass

import numpy as np

from mocks.physics.pose import Array
from mocks.physics.signals import Wander, mean_variance
from mocks.world import World

SAMPLES_PER_S = 500.0
PATH_INSTANTS = 24
STANDARD_AIR = (20.0, 1013.25, 50.0)


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations: range in mm, angles (across the beam) in rad.

    With a correlation time of 1 s of the slow part and these levels a 3 s dwell at 1.2 m to 1.4 m
    has 3 um along and 4 um across the beam.
    """

    white_range: float = 2e-3
    white_angle: float = 4e-6
    slow_range: float = 4.5e-3
    slow_angle: float = 4.6e-6


@dataclass(frozen=True)
class Dwell:
    """Mean of a dwell: ``xyz`` (3,) mm, ``scatter`` (3,) mm and ``sample_cov`` (3, 3) of the
    samples, ``cov`` (3, 3) of the mean, mm^2."""

    xyz: Array
    scatter: Array
    sample_cov: Array
    cov: Array


def beam_frame(point: Array) -> Array:
    """Rows: unit vectors along the beam, across it horizontally, across it upwards; (3, 3)."""
    along = point / np.linalg.norm(point)
    sideways = np.cross([0.0, 0.0, 1.0], along)
    sideways /= np.linalg.norm(sideways)
    return np.stack([along, sideways, np.cross(along, sideways)])


def refraction_ppm(temperature: float, pressure: float, humidity: float) -> float:
    """Refractive index against standard air, ppm (linear about 20 deg C, 1013.25 hPa, 50 %)."""
    t0, p0, h0 = STANDARD_AIR
    return -0.96 * (temperature - t0) + 0.27 * (pressure - p0) - 0.0085 * (humidity - h0)


class Sensor:
    """Turns true points into readings; the slow noise is as slow as the world's plan says.

    ``environment`` (deg C, hPa, %) is the air that the tracker assumes, None for the air as it
    is. ``range_error`` is added to every range, mm (a reflector that is not the one selected).
    """

    def __init__(self, world: World, noise: NoiseLevels | None = None) -> None:
        self._world = world
        self._noise = noise or NoiseLevels()
        self._rng = np.random.default_rng([world.plan.seed, 4])
        self._tau_s = world.plan.noise_tau_s
        self._slow = Wander(self._rng, self._tau_s, 3)
        self._two_face = world.plan.hidden.get("unknown.two-face.hz")
        self.environment: tuple[float, float, float] | None = None
        self.range_error = 0.0
        self.face = 1

    def air(self, time: float) -> tuple[float, float, float]:
        """Temperature, pressure and humidity as the weather station reads them."""
        t, climate = np.array([time]), self._world.climate
        temperature, pressure = float(climate.air(t)[0]), float(climate.pressure(t)[0])
        return round(temperature, 3), round(pressure, 2), round(climate.humidity, 1)

    def levels(self, distance: float) -> tuple[Array, Array]:
        """White and slow standard deviations along and across the beam, (3,) mm each."""
        n, reach = self._noise, distance * np.ones(2)
        white = np.array([n.white_range, *(n.white_angle * reach)])
        return white, np.array([n.slow_range, *(n.slow_angle * reach)])

    def dwell(self, smr: str, start: float, end: float) -> Dwell:
        """Mean over a dwell between two machine times."""
        middles = start + (end - start) * (np.arange(PATH_INSTANTS) + 0.5) / PATH_INSTANTS
        path = self._seen(smr, middles)
        mean = path.mean(axis=0)
        frame = beam_frame(mean)
        white, slow = self.levels(float(np.linalg.norm(mean)))
        samples = max(int(SAMPLES_PER_S * (end - start)), 2)
        noise = slow * self._slow.mean(start, end)
        noise = noise + white * self._rng.standard_normal(3) / np.sqrt(samples)
        share = mean_variance(end - start, self._tau_s)
        of_mean = white**2 / samples + share * slow**2
        of_sample = white**2 + (1.0 - share) * slow**2
        luck = self._rng.chisquare(samples - 1, 3) / (samples - 1)
        sample_cov = frame.T @ np.diag(of_sample * luck) @ frame + np.cov(path.T, bias=True)
        return Dwell(
            xyz=mean + noise @ frame,
            scatter=np.sqrt(np.diag(sample_cov)),
            sample_cov=sample_cov,
            cov=frame.T @ np.diag(of_mean) @ frame,
        )

    def samples(self, smr: str, times: Array) -> Array:
        """Single readings at ``times`` (N,), tracker frame, (N, 3), mm."""
        path = self._seen(smr, times)
        frame = beam_frame(path[0])
        white, slow = self.levels(float(np.linalg.norm(path[0])))
        noise = slow * self._slow.at(times).T + white * self._rng.standard_normal((times.size, 3))
        return np.asarray(path + noise @ frame)

    def _seen(self, smr: str, times: Array) -> Array:
        points = self._world.smr_in_tracker(smr, times)
        seen = self._world.distortions.seen(points, times)
        radius = np.linalg.norm(seen, axis=1, keepdims=True)
        true_air = self.air(float(times[-1]))
        ppm = refraction_ppm(*true_air) - refraction_ppm(*(self.environment or true_air))
        seen = seen * (1.0 + 1e-6 * ppm + self.range_error / radius)
        collimation = self._two_face * (1.0 if self.face == 1 else -1.0)
        sideways = np.column_stack([-seen[:, 1], seen[:, 0], np.zeros(times.size)])
        return np.asarray(seen + collimation * sideways)
