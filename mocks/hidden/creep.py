"""Actuators relax for minutes after every move; all moves before count."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array

TAU_S = 600.0


class Creep(HiddenEffect):
    """A part of every move that the actuator is short of at first, and makes good slowly."""

    id = "creep"
    numbers = "k|tau"
    says = (
        "k: part of every move that is still missing when it ends; tau s: how fast it is made good"
    )
    steady = ("tau",)
    trial = 1e-3
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Nobody overshoots; some minutes."""
        tau = float(np.exp(rng.uniform(np.log(90.0), np.log(1500.0))))
        return {"creep.k": 1.0, "creep.tau": tau}

    def example(self, site: Site) -> Table:
        """Two thousandths of every move, for five minutes."""
        return {"creep.k": 2e-3, "creep.tau": 300.0}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Each move is forgotten at the same rate, however long ago it was."""
        k, tau = hidden.get("creep.k"), hidden.get("creep.tau", TAU_S)

        def extension(c: Circumstances) -> Array:
            return -k * c.remembered(tau)

        return Physics(extension=extension)


EFFECTS = (Creep(),)
