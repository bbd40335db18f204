"""The circles of the tracker's encoders are not centred on their axes."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class TrackerEncoder(HiddenEffect):
    """Angles that are read wrong; the range is right."""

    id = "tracker-encoder"
    numbers = r"(azimuth|elevation)\.(sin|cos)"
    says = "rad: error of azimuth or elevation, once per turn"
    trial = 1e-4

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One circle, any phase, once per turn."""
        circle = str(rng.choice(["azimuth", "elevation"]))
        phase = float(rng.uniform(-np.pi, np.pi))
        waves = {"sin": float(np.sin(phase)), "cos": float(np.cos(phase))}
        return {f"tracker-encoder.{circle}.{wave}": size for wave, size in waves.items()}

    def example(self, site: Site) -> Table:
        """A hundred and fifty microradians, once per turn."""
        return {
            "tracker-encoder.azimuth.sin": 1.5e-4,
            "tracker-encoder.azimuth.cos": -5e-5,
            "tracker-encoder.elevation.sin": 5e-5,
        }

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Spherical coordinates, read wrong, and back."""
        table = {
            circle: (
                hidden.get(f"tracker-encoder.{circle}.sin"),
                hidden.get(f"tracker-encoder.{circle}.cos"),
            )
            for circle in ("azimuth", "elevation")
        }

        def wrong(circle: str, angle: Array) -> Array:
            sine, cosine = table[circle]
            return np.asarray(sine * np.sin(angle) + cosine * np.cos(angle))

        def seen(points: Array, times: Array, span_s: float | None) -> Array:
            distance = np.linalg.norm(points, axis=1)
            azimuth = np.arctan2(points[:, 1], points[:, 0])
            elevation = np.arcsin(points[:, 2] / distance)
            azimuth = azimuth + wrong("azimuth", azimuth)
            elevation = elevation + wrong("elevation", elevation)
            beam = [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
            return np.asarray(distance[:, None] * np.stack(beam, axis=1) - points)

        return Physics(seen=seen)


EFFECTS = (TrackerEncoder(),)
