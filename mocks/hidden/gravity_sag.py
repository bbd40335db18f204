"""What carries the platform gives way under its weight."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class GravitySag(HiddenEffect):
    """One compliance for all actuators; a tripod's long sides yield in its own body."""

    id = "gravity-sag"
    numbers = "c"
    says = "mm/N, rad/(N mm): compliance of legs, of a tripod's long sides, or of motors"
    trial = 1e-4
    trial_rotary = 1e-9

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """A compliance is never negative."""
        return {"gravity-sag.c": 1.0}

    def example(self, site: Site) -> Table:
        """As soft as a machine may be."""
        return {"gravity-sag.c": 3e-8 if site.rotary else 2e-4}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """The same everywhere."""
        c = hidden.get("gravity-sag.c")
        return Physics(compliance=lambda here: np.full(here.extension.shape, c))


EFFECTS = (GravitySag(),)
