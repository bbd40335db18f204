"""A leg in the sun, a screw beside its motor: one takes more of the warmth than another."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Site, Table, of_limbs


class LegWarming(HiddenEffect):
    """A growth per kelvin for each actuator; a hexapod's legs grow over their whole length."""

    id = "leg-warming"
    numbers = LIMB
    says = "mm/K (rad/K): growth of one actuator a kelvin away from 20 deg C, at home"
    trial = 1e-3
    trial_rotary = 1e-6

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """A sunny side."""
        first, *_, last = site.limbs
        unit = site.stroke.per_mm
        return {f"leg-warming.{first}": 4e-3 * unit, f"leg-warming.{last}": 2e-3 * unit}


EFFECTS = (LegWarming(),)
