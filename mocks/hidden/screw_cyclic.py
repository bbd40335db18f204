"""Once-per-turn error of each screw, or of each eccentric encoder."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array


class ScrewCyclic(HiddenEffect):
    """A sine and a cosine for each actuator, one period for all."""

    id = "screw-cyclic"
    numbers = rf"{LIMB}\.(sin|cos)|period"
    says = "mm (rad): amplitudes of sine and cosine; period in the same unit"
    steady = ("period",)
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Any period that a screw or an encoder may have; one limb or all, any phase."""
        low, high = (0.1, 6.28) if site.rotary else (1.5, 12.0)  # rad, mm
        table = {"screw-cyclic.period": float(np.exp(rng.uniform(np.log(low), np.log(high))))}
        for name, value in of_limbs(self.id, site, rng).items():
            phase = rng.uniform(0.0, 2.0 * np.pi)
            table[f"{name}.sin"] = float(value * np.cos(phase))
            table[f"{name}.cos"] = float(value * np.sin(phase))
        return table

    def example(self, site: Site) -> Table:
        """A sine here and a cosine there."""
        first, *_, last = site.limbs
        size = 0.01 * site.stroke.per_mm
        return {
            f"screw-cyclic.{first}.sin": size,
            f"screw-cyclic.{last}.cos": -size,
            "screw-cyclic.period": 0.9 if site.rotary else 3.3,
        }

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Waves along the extension."""
        sine = hidden.limbs("screw-cyclic.*.sin", limbs)
        cosine = hidden.limbs("screw-cyclic.*.cos", limbs)
        period = hidden.get("screw-cyclic.period", stroke.cycle)

        def extension(c: Circumstances) -> Array:
            turn = 2.0 * np.pi * c.extension / period
            return np.asarray(sine * np.sin(turn) + cosine * np.cos(turn))

        return Physics(extension=extension)


EFFECTS = (ScrewCyclic(),)
