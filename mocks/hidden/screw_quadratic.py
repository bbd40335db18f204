"""A screw whose pitch changes along its length: not in the catalogue."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class ScrewQuadratic(HiddenEffect):
    """An extension that grows with the square."""

    id = "unknown.screw-quadratic"
    numbers = LIMB
    says = "1/mm (1/rad): extension = k s^2"
    trial = 1e-5
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """One actuator."""
        return {f"unknown.screw-quadratic.{site.limbs[0]}": 1e-5 / site.stroke.per_mm}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """In proportion to the square of the extension."""
        k = hidden.limbs("unknown.screw-quadratic.*", limbs)
        return Physics(extension=lambda c: k * c.extension**2)


EFFECTS = (ScrewQuadratic(),)
