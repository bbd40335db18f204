"""A stand, or a floor, that gives way under the machine with what it carries."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class BaseBending(HiddenEffect):
    """Base nests stand beside it."""

    id = "base-bending"
    numbers = "lean|sink"
    says = "rad/(N mm): how far the machine leans under a moment; mm/N: how far it sinks"
    trial = 1e-8

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Nothing rises under a weight."""
        return {"base-bending.lean": abs(float(rng.standard_normal()))}

    def example(self, site: Site) -> Table:
        """A light stand."""
        return {"base-bending.lean": 2e-8, "base-bending.sink": 1e-4}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """A small turn about the base origin by the level part of the moment, and down."""
        lean, sink = hidden.get("base-bending.lean"), hidden.get("base-bending.sink")

        def stand(force: Array, moment: Array) -> Array:
            down = force / np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-300)
            upright = np.sum(moment * down, axis=1, keepdims=True)
            return np.concatenate([sink * force, lean * (moment - upright * down)], axis=1)

        return Physics(stand=stand)


EFFECTS = (BaseBending(),)
