"""A cable that is taut, a bellows that is full, a soft stop: felt on one side of a place only."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table, of_limbs
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array


class Contact(HiddenEffect):
    """A softness for each actuator, one place, and on which side of it something is felt."""

    id = "contact"
    numbers = f"{LIMB}|at|side"
    says = "1: yield per way beyond at (0 to 1 between the limits); side -1: short of it"
    steady = ("at", "side")
    trial = 1e-3

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Somewhere about the middle of the way; whatever pulls, pulls back."""
        side = float(rng.choice([-1.0, 1.0]))
        pulled = {name: -side * abs(v) for name, v in of_limbs(self.id, site, rng).items()}
        return {**pulled, "contact.at": float(rng.uniform(0.35, 0.65)), "contact.side": side}

    def example(self, site: Site) -> Table:
        """The first most."""
        first, *_, last = site.limbs
        return {
            f"contact.{first}": -2e-3,
            f"contact.{last}": -1e-3,
            "contact.at": 0.55,
            "contact.side": 1.0,
        }

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Nothing until there, then in proportion to the way."""
        soft = hidden.limbs("contact.*", limbs)
        first, last = (np.asarray(end) for end in stroke.ends)
        at = first + hidden.get("contact.at", 0.5) * (last - first)
        side = hidden.get("contact.side", 1.0)

        def extension(c: Circumstances) -> Array:
            way = (c.extension - at) * (1.0 if side > 0.0 else -1.0)
            return np.asarray(soft * np.where(way > 0.0, way, 0.0))

        return Physics(extension=extension)


EFFECTS = (Contact(),)
