"""Friction behind a spring: the actuator lags, and a reversal is felt for some way."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array

REACH_MM = 3.0


class OneLoop(HiddenEffect):
    """A play element for each actuator, wide, and only a part of it comes through."""

    id = "hysteresis"
    numbers = f"{LIMB}|reach"
    says = "mm (rad): half the width of the loop; reach, in the same unit, half the way through it"
    steady = ("reach",)
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all; friction only lags."""
        lag = {name: abs(value) for name, value in of_limbs(self.id, site, rng).items()}
        return {**lag, "hysteresis.reach": float(rng.uniform(1.0, 10.0)) * site.stroke.per_mm}

    def example(self, site: Site) -> Table:
        """Two, one twice as much."""
        first, *_, last = site.limbs
        unit = site.stroke.per_mm
        return {
            f"hysteresis.{first}": 0.02 * unit,
            f"hysteresis.{last}": 0.01 * unit,
            "hysteresis.reach": 4.0 * unit,
        }

    def widths(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Array:
        """One element for each actuator."""
        reach = hidden.get("hysteresis.reach", REACH_MM * stroke.per_mm)
        return np.full((len(limbs), 1), 2.0 * reach)

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Where the element stands, as a part of half its width."""
        lag = hidden.limbs("hysteresis.*", limbs)
        reach = hidden.get("hysteresis.reach", REACH_MM * stroke.per_mm)
        return Physics(extension=lambda c: lag * c.play[:, :, 0] / reach)


EFFECTS = (OneLoop(),)
