"""An unguided screw turns as the joints swing, in the hexapod's body."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Site, Table, either_sign


class ScrewTwist(HiddenEffect):
    """One lead for all screws."""

    id = "screw-twist"
    numbers = "L"
    says = "mm a turn: lead of the screws"
    machines = ("hexapod",)
    arms = False
    trial = 1.0

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either hand."""
        return either_sign("screw-twist.L", rng)

    def example(self, site: Site) -> Table:
        """A fine screw."""
        return {"screw-twist.L": 1.5}


EFFECTS = (ScrewTwist(),)
