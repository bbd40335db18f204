"""Each leg or motor gives way under its part of the weight, one more than another."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class LegCompliance(HiddenEffect):
    """A compliance for each actuator; a tripod's sliders hold."""

    id = "leg-compliance"
    numbers = LIMB
    says = "mm/N, rad/(N mm): compliance of one leg or motor"
    machines = ("hexapod", "ptm")
    trial = 1e-4
    trial_rotary = 1e-9

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """A compliance is never negative."""
        return {name: abs(value) for name, value in of_limbs(self.id, site, rng).items()}

    def example(self, site: Site) -> Table:
        """Two soft ones, one of them twice as soft."""
        first, *_, last = site.loaded
        soft = 3e-8 if site.rotary else 4e-4
        return {f"leg-compliance.{first}": soft, f"leg-compliance.{last}": 0.5 * soft}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Whatever they carry, each is as soft as it is."""
        c = hidden.limbs("leg-compliance.*", limbs)
        return Physics(compliance=lambda here: np.broadcast_to(c, here.extension.shape))


EFFECTS = (LegCompliance(),)
