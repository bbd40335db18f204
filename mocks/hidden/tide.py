"""The floor heaves in a rhythm: not in the catalogue."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class Tide(HiddenEffect):
    """Up and down, under the tracker."""

    id = "unknown.tide"
    numbers = "amplitude|period"
    says = "amplitude in mm, period in s: the floor heaves in a rhythm"
    steady = ("period",)

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """A rhythm of some minutes."""
        period = float(rng.uniform(400, 1500))
        return {"unknown.tide.amplitude": 1.0, "unknown.tide.period": period}

    def example(self, site: Site) -> Table:
        """Every four minutes."""
        return {"unknown.tide.amplitude": 0.02, "unknown.tide.period": 240.0}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """All points alike."""
        amplitude = hidden.get("unknown.tide.amplitude")
        period = hidden.get("unknown.tide.period", 240.0)

        def seen(points: Array, times: Array, span_s: float | None) -> Array:
            moved = np.zeros(points.shape)
            moved[:, 2] = amplitude * np.sin(2.0 * np.pi * times / period)
            return moved

        return Physics(seen=seen)


EFFECTS = (Tide(),)
