"""Friction of a nut or a joint under load: a reversal loses more way, the more is carried."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array


class LoadedBacklash(HiddenEffect):
    """A lost motion per force for each actuator; a tripod's rods share the load."""

    id = "loaded-backlash"
    numbers = LIMB
    says = "mm/N, rad/(N mm): way lost at a reversal per force in one leg or motor"
    machines = ("hexapod", "ptm")
    trial = 1e-4
    trial_rotary = 1e-9

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Friction only holds back."""
        return {name: abs(value) for name, value in of_limbs(self.id, site, rng).items()}

    def example(self, site: Site) -> Table:
        """Two, one of them twice as stiff in its nut."""
        first, *_, last = site.loaded
        lost = 3e-8 if site.rotary else 6e-4
        return {f"loaded-backlash.{first}": lost, f"loaded-backlash.{last}": 0.5 * lost}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Half of it behind, on either side."""
        lost = hidden.limbs("loaded-backlash.*", limbs)

        def held_back(c: Circumstances) -> Array:
            return np.asarray(np.where(c.step > 0, -lost, np.where(c.step < 0, lost, 0.0)) / 2.0)

        return Physics(friction=held_back)


EFFECTS = (LoadedBacklash(),)
