"""A nest that is pushed aside when somebody puts the SMR into it."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Nest, Physics, Site, Table, of_names
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array


class NestStep(HiddenEffect):
    """One nest or several, at one moment."""

    id = "nest-step"
    numbers = r"[^.]+\.[xyz]|t0"
    says = "mm: how far a nest moves at t0 s, in the frame that carries it"
    steady = ("t0",)

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One nest, while it is read: nests are read one after the other."""
        number = int(rng.integers(len(site.nests)))
        share = (number + float(rng.uniform(0.25, 0.75))) / len(site.nests)
        stem = f"nest-step.{site.nests[number]}"
        table = of_names([f"{stem}.{axis}" for axis in "xyz"], rng)
        return {**table, "nest-step.t0": share * site.span_s}

    def example(self, site: Site) -> Table:
        """One nest, sideways and down."""
        nest = site.nests[1]
        return {
            f"nest-step.{nest}.x": 0.04,
            f"nest-step.{nest}.z": -0.05,
            "nest-step.t0": 0.5 * site.span_s,
        }

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """From then on."""
        moment = hidden.get("nest-step.t0", np.inf)

        def nest(where: Nest, times: Array, down: Array) -> Array:
            moved = hidden.vector(f"nest-step.{where.name}")
            return np.asarray(np.where((times >= moment)[:, None], moved, 0.0))

        return Physics(nest=nest)


EFFECTS = (NestStep(),)
