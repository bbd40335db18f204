"""What the structure is made of grows with its temperature; each body knows how."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Site, Table


class ThermalGrowth(HiddenEffect):
    """One coefficient: legs of the hexapod, rods of the tripod, links of the ptm."""

    id = "thermal-growth"
    numbers = "a"
    says = "1/K: relative growth of legs, rods or links a kelvin away from 20 deg C"
    trial = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Steel shrinks nowhere."""
        return {"thermal-growth.a": 1.0}

    def example(self, site: Site) -> Table:
        """Steel."""
        return {"thermal-growth.a": 1.2e-5}


EFFECTS = (ThermalGrowth(),)
