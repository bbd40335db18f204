"""A limb that does not carry its constraint, in the ptm's body."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Site, Table


class Redundancy(HiddenEffect):
    """The constraint of one of four limbs released."""

    id = "redundancy"
    numbers = "limb|share"
    says = "limb 1 to 4 whose constraint is released, wholly or by a share of its stiffness"
    machines = ("ptm",)
    arms = False
    steady = ("limb",)
    trial = 0.1
    linear = False

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Any limb."""
        return {"redundancy.limb": float(rng.integers(1, 5)), "redundancy.share": 1.0}

    def example(self, site: Site) -> Table:
        """One limb, wholly."""
        return {"redundancy.limb": 2.0, "redundancy.share": 1.0}


EFFECTS = (Redundancy(),)
