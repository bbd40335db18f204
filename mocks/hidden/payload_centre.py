"""A payload that was put on beside its place, or whose drawing is wrong."""

import numpy as np

from mocks.hidden.effect import EVERYWHERE, HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class PayloadCentre(HiddenEffect):
    """Moves nothing by itself: what gives way under the weight shows it."""

    id = "payload-centre"
    numbers = "x|y|z"
    says = "mm: where the payload's centre of mass is, less where it is said to be, platform frame"
    unseen = EVERYWHERE
    linear = False

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Sideways, on a machine that yields."""
        return {**self.example(site), "payload-centre.y": 10.0 * float(rng.standard_normal())}

    def example(self, site: Site) -> Table:
        """Far off, on a machine as soft as one may be."""
        return {
            "payload-centre.x": 30.0,
            "payload-centre.y": -20.0,
            "gravity-sag.c": 3e-8 if site.rotary else 2e-4,
        }

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """The load is another one."""
        return Physics(payload_off=hidden.vector("payload-centre"))


EFFECTS = (PayloadCentre(),)
