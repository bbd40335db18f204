"""A screw that is cut worse at its ends, an encoder whose divisions widen: the lead changes."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class LeadVariation(HiddenEffect):
    """The lead itself is off by 2 k s: it adds up to the square."""

    id = "lead-variation"
    numbers = LIMB
    says = "1/mm (1/rad): extension = k s^2"
    trial = 1e-5
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """Two actuators."""
        first, *_, last = site.limbs
        size = 1e-5 / site.stroke.per_mm
        return {f"lead-variation.{first}": size, f"lead-variation.{last}": -2.0 * size}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """In proportion to the square of the extension."""
        k = hidden.limbs("lead-variation.*", limbs)
        return Physics(extension=lambda c: k * c.extension**2)


EFFECTS = (LeadVariation(),)
