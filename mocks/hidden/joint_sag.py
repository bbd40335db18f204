"""Links of an arm that pull at the joints before them; the body knows how they hang."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Site, Table


class JointSag(HiddenEffect):
    """Two numbers a joint: where its link hangs does not say how heavy or soft it is."""

    id = "joint-sag"
    numbers = r"q\d\.[xy]"
    says = "rad: how far a joint gives way where gravity points along an axis across it"
    machines = ("arm",)
    trial = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One of the joints that hang."""
        limb = rng.choice(site.limbs[1:])
        return {f"joint-sag.{limb}.{way}": float(rng.standard_normal()) for way in "xy"}

    def example(self, site: Site) -> Table:
        """A heavy forearm."""
        return {f"joint-sag.{site.limbs[2]}.x": 2e-4, f"joint-sag.{site.limbs[2]}.y": -1e-4}


EFFECTS = (JointSag(),)
