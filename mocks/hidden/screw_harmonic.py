"""Waves within a turn of each screw: two, three or four a turn."""

import numpy as np

from mocks.hidden.effect import EVERYWHERE, LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array


class ScrewHarmonic(HiddenEffect):
    """A sine and a cosine for each actuator, one period for all; drawn with the turn itself."""

    id = "screw-harmonic"
    numbers = rf"{LIMB}\.(sin|cos)|period"
    says = "mm (rad): amplitudes of a second wave; period in the same unit, a part of a turn"
    steady = ("period",)
    unseen = EVERYWHERE
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """A half or a third of the usual turn."""
        part = site.stroke.cycle / float(rng.integers(2, 4))
        waves = {f"{name}.sin": value for name, value in of_limbs(self.id, site, rng).items()}
        return {**waves, "screw-harmonic.period": part}

    def example(self, site: Site) -> Table:
        """Twice a turn."""
        first, *_, last = site.limbs
        size = 0.01 * site.stroke.per_mm
        return {
            f"screw-harmonic.{first}.cos": size,
            f"screw-harmonic.{last}.sin": size,
            "screw-harmonic.period": 0.45 if site.rotary else 1.65,
        }

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Waves along the extension."""
        waves = [hidden.limbs(f"screw-harmonic.*.{name}", limbs) for name in ("sin", "cos")]
        period = hidden.get("screw-harmonic.period", 0.5 * stroke.cycle)

        def extension(c: Circumstances) -> Array:
            turned = 2.0 * np.pi * c.extension / period
            return np.asarray(waves[0] * np.sin(turned) + waves[1] * np.cos(turned))

        return Physics(extension=extension)


EFFECTS = (ScrewHarmonic(),)
