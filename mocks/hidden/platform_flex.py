"""Nests sag within the platform when it tilts: not in the catalogue."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Nest, Physics, Site, Table, either_sign
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class PlatformFlex(HiddenEffect):
    """Along the part of gravity that lies in the platform's plane; a tripod's does not tilt."""

    id = "unknown.platform-flex"
    numbers = "k"
    says = "mm: nests sag within the platform when it tilts"
    unseen = ("tripod",)
    trial = 1e-2

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either sign."""
        return either_sign("unknown.platform-flex.k", rng)

    def example(self, site: Site) -> Table:
        """A twentieth of a millimetre on edge."""
        return {"unknown.platform-flex.k": 0.05}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """In proportion to the tilt."""
        k = hidden.get("unknown.platform-flex.k")

        def nest(where: Nest, times: Array, down: Array) -> Array:
            return np.asarray(k * down * [1.0, 1.0, 0.0] * where.on_platform)

        return Physics(nest=nest)


EFFECTS = (PlatformFlex(),)
