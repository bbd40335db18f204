"""Friction in several places: an extension with a memory of several past reversals."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array

WIDTHS_MM = (0.3, 2.0, 8.0)


class Hysteresis(HiddenEffect):
    """Mean of three play elements, each as a part of its half width (Prandtl and Ishlinskii)."""

    id = "unknown.hysteresis"
    numbers = LIMB
    says = "mm (rad): extension with a memory of several past reversals"
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all."""
        return of_limbs(self.id, site, rng)

    def example(self, site: Site) -> Table:
        """One actuator."""
        return {f"unknown.hysteresis.{site.limbs[0]}": 0.02 * site.stroke.per_mm}

    def widths(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Array:
        """Three widths, the same for all actuators."""
        return np.tile(np.asarray(WIDTHS_MM) * stroke.per_mm, (len(limbs), 1))

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """The mean of the elements."""
        size = hidden.limbs("unknown.hysteresis.*", limbs)
        half = 0.5 * np.asarray(WIDTHS_MM) * stroke.per_mm
        return Physics(extension=lambda c: size * (c.play / half).mean(axis=2))


EFFECTS = (Hysteresis(),)
