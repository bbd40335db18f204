"""Legs whose compliance grows as they come out: not in the catalogue."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table, either_sign
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class SoftLegs(HiddenEffect):
    """A compliance in proportion to the extension."""

    id = "unknown.soft-legs"
    numbers = "k"
    says = "1/N: compliance that grows with extension, k s F"
    machines = ("hexapod",)
    arms = False
    trial = 1e-6

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either sign."""
        return either_sign("unknown.soft-legs.k", rng)

    def example(self, site: Site) -> Table:
        """A tenth of a common compliance at 20 mm."""
        return {"unknown.soft-legs.k": 1e-6}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """In proportion to the extension."""
        k = hidden.get("unknown.soft-legs.k")
        return Physics(compliance=lambda here: k * here.extension)


EFFECTS = (SoftLegs(),)
