"""Every screw has its own gain."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class ScrewPitch(HiddenEffect):
    """A gain for each actuator."""

    id = "screw-pitch"
    numbers = LIMB
    says = "1: relative gain of an actuator"
    trial = 1e-3
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """Two actuators, of opposite sign."""
        first, *_, last = site.limbs
        return {f"screw-pitch.{first}": 1e-3, f"screw-pitch.{last}": -5e-4}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """In proportion to the extension."""
        gain = hidden.limbs("screw-pitch.*", limbs)
        return Physics(extension=lambda c: gain * c.extension)


EFFECTS = (ScrewPitch(),)
