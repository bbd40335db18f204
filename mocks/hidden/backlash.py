"""Lost motion: a play operator, so that a reversal smaller than the gap moves part of the way."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class Backlash(HiddenEffect):
    """Full width of each actuator's gap."""

    id = "backlash"
    numbers = LIMB
    says = "mm (rad): width of the gap that an actuator crosses when it turns round"
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """A width is never negative."""
        return {name: abs(value) for name, value in of_limbs(self.id, site, rng).items()}

    def example(self, site: Site) -> Table:
        """Two actuators, one with twice the gap of the other."""
        first, *_, last = site.limbs
        unit = site.stroke.per_mm
        return {f"backlash.{first}": 0.02 * unit, f"backlash.{last}": 0.01 * unit}

    def widths(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Array:
        """The gap."""
        return np.abs(hidden.limbs("backlash.*", limbs))[:, None]

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Where the driven part stands in its gap."""
        # A negative backlash is not physical, but a file may ask for the mirrored sign.
        sign = np.where(hidden.limbs("backlash.*", limbs) < 0.0, -1.0, 1.0)
        return Physics(extension=lambda c: sign * c.play[:, :, 0])


EFFECTS = (Backlash(),)
