"""Cold drives that do not all warm up alike: each goes to its length by its own amount."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array

TAU_S = 1800.0


class LegWarmUp(HiddenEffect):
    """An amplitude for each actuator, one time constant."""

    id = "leg-warm-up"
    numbers = f"{LIMB}|tau"
    says = "mm (rad): by how much one actuator is too long in the cold; tau s: how fast it goes"
    steady = ("tau",)
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One limb or all, some tenths of the run."""
        tau = float(rng.uniform(0.15, 0.6)) * site.span_s
        return {**of_limbs(self.id, site, rng), "leg-warm-up.tau": tau}

    def example(self, site: Site) -> Table:
        """The first most, the last the other way."""
        first, *_, last = site.limbs
        size = 0.03 * site.stroke.per_mm
        return {
            f"leg-warm-up.{first}": size,
            f"leg-warm-up.{last}": -0.5 * size,
            "leg-warm-up.tau": 0.3 * site.span_s,
        }

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """What is left of the cold."""
        size = hidden.limbs("leg-warm-up.*", limbs)
        rate = 1.0 / hidden.get("leg-warm-up.tau", TAU_S)

        def extension(c: Circumstances) -> Array:
            return np.asarray(size / np.exp(rate * c.time)[:, None])

        return Physics(extension=extension)


EFFECTS = (LegWarmUp(),)
