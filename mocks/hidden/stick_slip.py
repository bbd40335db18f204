"""Friction holds an actuator back: after a small step it hangs short of where it was told to go."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array

REACH_MM = 4.0


class StickSlip(HiddenEffect):
    """How far each actuator hangs back after the smallest step; large steps shake it free."""

    id = "stick-slip"
    numbers = f"{LIMB}|reach"
    says = "mm (rad): how far an actuator falls short after a step much smaller than reach"
    steady = ("reach",)
    trial_rotary = 3e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One actuator or all; nobody overshoots."""
        short = {name: abs(value) for name, value in of_limbs(self.id, site, rng).items()}
        return {**short, "stick-slip.reach": float(rng.uniform(3.0, 15.0)) * site.stroke.per_mm}

    def example(self, site: Site) -> Table:
        """The first actuator most."""
        unit = site.stroke.per_mm
        short = {f"stick-slip.{limb}": 0.02 * unit for limb in site.limbs[1:]}
        first = {f"stick-slip.{site.limbs[0]}": 0.04 * unit}
        return {**first, **short, "stick-slip.reach": 8.0 * unit}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Behind by less and less, the longer the step was."""
        short = hidden.limbs("stick-slip.*", limbs)
        reach = hidden.get("stick-slip.reach", REACH_MM * stroke.per_mm)

        def extension(c: Circumstances) -> Array:
            way = np.sqrt(c.step**2)
            behind = short / np.exp(way / reach)
            return np.asarray(np.where(c.step > 0, -behind, np.where(c.step < 0, behind, 0.0)))

        return Physics(extension=extension)


EFFECTS = (StickSlip(),)
