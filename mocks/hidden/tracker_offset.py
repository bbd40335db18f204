"""The tracker's range zero is off."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table, either_sign
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke


class TrackerOffset(HiddenEffect):
    """One length."""

    id = "tracker-offset"
    numbers = "r0"
    says = "mm: constant error of every range"

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Either sign."""
        return either_sign("tracker-offset.r0", rng)

    def example(self, site: Site) -> Table:
        """A dirty birdbath."""
        return {"tracker-offset.r0": 0.1}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Along the beam."""
        r0 = hidden.get("tracker-offset.r0")
        return Physics(
            seen=lambda points, times, span_s: (
                r0 * points / np.linalg.norm(points, axis=1, keepdims=True)
            )
        )


EFFECTS = (TrackerOffset(),)
