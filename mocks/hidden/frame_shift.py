"""The base reference or the tool was touched at some moment of the run: a rigid step."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Nest, Physics, Site, Table, of_names
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array, rotation_from_vector


class FrameShift(HiddenEffect):
    """A step of the platform's nests in their frame, or of everything in the base frame."""

    id = "frame-shift"
    numbers = "x|y|z|rx|ry|rz|t0|where"
    says = "mm, rad: a rigid step at t0 s; where: 0 of the platform's nests, 1 of the base"
    steady = ("t0", "where")

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Sideways, in the middle part of the run, here or there."""
        table = of_names([f"frame-shift.{axis}" for axis in "xyz"], rng)
        table["frame-shift.where"] = float(rng.integers(2))
        table["frame-shift.t0"] = float(rng.uniform(0.2, 0.8)) * site.span_s
        return table

    def example(self, site: Site) -> Table:
        """The tool, half way."""
        half = 0.5 * site.span_s
        return {"frame-shift.x": 0.05, "frame-shift.ry": 2e-4, "frame-shift.t0": half}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """About the origin of the frame that steps."""
        moment = hidden.get("frame-shift.t0", np.inf)
        shift = hidden.vector("frame-shift", "x y z rx ry rz")
        turn = rotation_from_vector(shift[None, 3:])[0]

        def moved(points: Array, times: Array) -> Array:
            step = points @ turn.T + shift[:3] - points
            return np.asarray(np.where((times >= moment)[:, None], step, 0.0))

        if hidden.get("frame-shift.where") > 0.5:
            return Physics(base=moved)

        def nest(where: Nest, times: Array, down: Array) -> Array:
            return moved(np.zeros(down.shape) + where.centre, times) * where.on_platform

        return Physics(nest=nest)


EFFECTS = (FrameShift(),)
