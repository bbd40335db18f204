"""Long sides of a parallelogram that differ, in the tripod's body."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Site, Table, of_limbs


class ParallelogramSides(HiddenEffect):
    """One number a limb."""

    id = "parallelogram-sides"
    numbers = LIMB
    says = "mm: side 1 less side 2"
    machines = ("tripod",)
    arms = False

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """Two limbs, of opposite sign."""
        first, *_, last = site.limbs
        return {f"parallelogram-sides.{first}": 0.03, f"parallelogram-sides.{last}": -0.5 * 0.03}


EFFECTS = (ParallelogramSides(),)
