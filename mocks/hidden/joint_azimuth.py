"""Platform joints that are turned against their sliders, in the tripod's body."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Site, Table, of_limbs


class JointAzimuth(HiddenEffect):
    """One number a limb."""

    id = "joint-azimuth"
    numbers = LIMB
    says = "rad: platform joint's azimuth less the slider's"
    machines = ("tripod",)
    arms = False
    trial = 1e-4

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """Two limbs, of opposite sign."""
        first, *_, last = site.limbs
        return {f"joint-azimuth.{first}": 1e-3, f"joint-azimuth.{last}": -0.5 * 1e-3}


EFFECTS = (JointAzimuth(),)
