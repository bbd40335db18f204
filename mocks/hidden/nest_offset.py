"""An SMR nest is not where the drawing says."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Nest, Physics, Site, Table, of_names
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class NestOffset(HiddenEffect):
    """Three components a nest, on the platform or on the base."""

    id = "nest-offset"
    numbers = r"[^.]+\.[xyz]"
    says = "mm: where a nest is, less where the drawing says, in the frame that carries it"

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One nest of the platform."""
        nest = site.nests[rng.integers(len(site.nests))]
        return of_names([f"nest-offset.{nest}.{axis}" for axis in "xyz"], rng)

    def example(self, site: Site) -> Table:
        """One nest, sideways and down."""
        nest = site.nests[1]
        return {f"nest-offset.{nest}.x": 0.03, f"nest-offset.{nest}.z": -0.05}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """The same at all times."""
        names = {name.split(".")[1] for name in hidden.values if self.known(name)}
        moved = {name: hidden.vector(f"nest-offset.{name}") for name in names}

        def nest(where: Nest, times: Array, down: Array) -> Array:
            return np.zeros(down.shape) + moved.get(where.name, np.zeros(3))

        return Physics(nest=nest)


EFFECTS = (NestOffset(),)
