"""Legs bend in the sun, in the hexapod's body: not in the catalogue."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Site, Table, either_sign


class Bending(HiddenEffect):
    """Structure warmer than air, sunny side more."""

    id = "unknown.bending"
    numbers = "k"
    says = "mm/K: legs bend when structure and air differ, sunny side more"
    machines = ("hexapod",)
    arms = False
    trial = 1e-3

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either sign."""
        return either_sign("unknown.bending.k", rng)

    def example(self, site: Site) -> Table:
        """A hundredth of a millimetre for some kelvin."""
        return {"unknown.bending.k": 3e-3}


EFFECTS = (Bending(),)
