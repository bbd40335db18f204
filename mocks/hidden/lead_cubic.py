"""A screw that is worn at both ends: its error grows with the cube of the way from home."""

import numpy as np

from mocks.hidden.effect import EVERYWHERE, LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class LeadCubic(HiddenEffect):
    """Odd in the way: short on one side, long on the other."""

    id = "lead-cubic"
    numbers = LIMB
    says = "1/mm^2 (1/rad^2): extension = k s^3"
    unseen = EVERYWHERE
    trial = 3e-7
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """Two actuators."""
        first, *_, last = site.limbs
        size = 1e-3 if site.machine == "arm" else 5e-7 / site.stroke.per_mm**2
        return {f"lead-cubic.{first}": size, f"lead-cubic.{last}": -size}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Cube, times a number each."""
        k = hidden.limbs("lead-cubic.*", limbs)
        return Physics(extension=lambda c: k * np.power(c.extension, 3))


EFFECTS = (LeadCubic(),)
