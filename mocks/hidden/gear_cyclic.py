"""Gears that err with the turn of their motors; how often these turn, the arm knows."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array


class GearCyclic(HiddenEffect):
    """Once and twice a turn of the motor."""

    id = "gear-cyclic"
    numbers = r"q\d\.(sin|cos)[12]"
    says = "rad: waves once and twice a turn of the motor"
    machines = ("arm",)
    trial = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One joint, one harmonic, any phase."""
        limb, order = rng.choice(site.limbs), int(rng.integers(1, 3))
        phase = float(rng.uniform(-np.pi, np.pi))
        stem = f"gear-cyclic.{limb}"
        return {f"{stem}.sin{order}": float(np.sin(phase)), f"{stem}.cos{order}": np.cos(phase)}

    def example(self, site: Site) -> Table:
        """A strain wave gear: twice a turn."""
        second, fourth = site.limbs[1], site.limbs[3]
        return {f"gear-cyclic.{second}.sin2": 1e-4, f"gear-cyclic.{fourth}.cos1": 8e-5}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Waves along the turn of the motor."""
        ratio = np.array(stroke.gears or np.zeros(len(limbs)))
        waves = {
            (name, order): hidden.limbs(f"gear-cyclic.*.{name}{order}", limbs)
            for name in ("sin", "cos")
            for order in (1, 2)
        }

        def extension(c: Circumstances) -> Array:
            motor = ratio * c.extension
            error = np.zeros(c.extension.shape)
            for (name, order), size in waves.items():
                wave = np.sin if name == "sin" else np.cos
                error = error + size * wave(order * motor)
            return error

        return Physics(extension=extension)


EFFECTS = (GearCyclic(),)
