"""The machine still creeps when the dwell begins."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array

TAU_S = 5.0


class Settling(HiddenEffect):
    """A part of the last step that dies away."""

    id = "settling"
    numbers = "k|tau"
    says = "k: part of the last step that is left when it ends; tau s: how fast it dies away"
    steady = ("tau",)
    trial = 1e-3
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either sign, some seconds."""
        k = float(rng.choice([-1.0, 1.0]))
        return {"settling.k": k, "settling.tau": float(rng.uniform(1, 4))}

    def example(self, site: Site) -> Table:
        """Two thousandths of every step, for some seconds."""
        return {"settling.k": 2e-3, "settling.tau": 2.0}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Not while the move lasts."""
        k, tau = hidden.get("settling.k"), hidden.get("settling.tau", TAU_S)

        def extension(c: Circumstances) -> Array:
            return np.asarray(k * c.step * np.exp(-np.maximum(c.delay, 0.0) / tau))

        return Physics(extension=extension)


EFFECTS = (Settling(),)
