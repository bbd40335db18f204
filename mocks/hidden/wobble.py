"""Bearing error of the tracker's vertical axis: not in the catalogue."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class Wobble(HiddenEffect):
    """Up and down with the azimuth."""

    id = "unknown.wobble"
    numbers = "amplitude|period"
    says = "amplitude in mm, period in deg: bearing error of the tracker's vertical axis"
    steady = ("period",)

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Some degrees a ball."""
        return {"unknown.wobble.amplitude": 1.0, "unknown.wobble.period": float(rng.uniform(5, 20))}

    def example(self, site: Site) -> Table:
        """Seven degrees."""
        return {"unknown.wobble.amplitude": 0.02, "unknown.wobble.period": 7.0}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """A wave in the azimuth at which the tracker looks."""
        amplitude = hidden.get("unknown.wobble.amplitude")
        period = np.radians(hidden.get("unknown.wobble.period", 7.0))

        def seen(points: Array, times: Array, span_s: float | None) -> Array:
            moved = np.zeros(points.shape)
            azimuth = np.arctan2(points[:, 1], points[:, 0])
            moved[:, 2] = amplitude * np.sin(2.0 * np.pi * azimuth / period)
            return moved

        return Physics(seen=seen)


EFFECTS = (Wobble(),)
