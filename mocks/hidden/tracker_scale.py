"""A wrong refractive index scales every range."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table, either_sign
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class TrackerScale(HiddenEffect):
    """One ratio."""

    id = "tracker-scale"
    numbers = "k"
    says = "1: relative error of every range"
    trial = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either sign."""
        return either_sign("tracker-scale.k", rng)

    def example(self, site: Site) -> Table:
        """A hundred kelvin wrong."""
        return {"tracker-scale.k": 1e-4}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """In proportion to the point."""
        k = hidden.get("tracker-scale.k")
        return Physics(seen=lambda points, times, span_s: k * points)


EFFECTS = (TrackerScale(),)
