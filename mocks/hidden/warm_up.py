"""A cold machine: screws and drives reach their lengths while they warm up."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table, either_sign
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array

TAU_S = 1800.0


class WarmUp(HiddenEffect):
    """All actuators alike."""

    id = "warm-up"
    numbers = "A|tau"
    says = "mm (rad): by how much every actuator is too long in the cold; tau s: how fast it goes"
    steady = ("tau",)
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either sign, some tenths of the run."""
        tau = float(rng.uniform(0.15, 0.6)) * site.span_s
        return {**either_sign("warm-up.A", rng), "warm-up.tau": tau}

    def example(self, site: Site) -> Table:
        """Thirty micrometres, gone for the most part half way."""
        return {"warm-up.A": 0.03 * site.stroke.per_mm, "warm-up.tau": 0.3 * site.span_s}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """A single time constant."""
        size, tau = hidden.get("warm-up.A"), hidden.get("warm-up.tau", TAU_S)

        def extension(c: Circumstances) -> Array:
            cold = size * np.exp(-c.time / tau)
            return np.asarray(np.repeat(cold[:, None], c.extension.shape[1], axis=1))

        return Physics(extension=extension)


EFFECTS = (WarmUp(),)
