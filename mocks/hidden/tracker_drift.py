"""The tracker's stand moves slowly."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table, of_names
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array

DURATION_S = 3600.0


class TrackerDrift(HiddenEffect):
    """A rigid motion that grows in proportion to time, over the campaign or a given duration."""

    id = "tracker-drift"
    numbers = "[vw][xyz]|duration"
    says = "mm, rad: motion of the stand over the campaign; on a live machine over duration s"
    steady = ("duration",)

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Any motion."""
        table = of_names([f"tracker-drift.v{axis}" for axis in "xyz"], rng)
        turns = {f"tracker-drift.w{axis}": float(7e-4 * rng.standard_normal()) for axis in "xyz"}
        return table | turns

    def example(self, site: Site) -> Table:
        """A step aside and a turn."""
        return {"tracker-drift.vx": 0.05, "tracker-drift.wz": 3e-5}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """About the tracker."""
        v = hidden.vector("tracker-drift", "vx vy vz")
        w = hidden.vector("tracker-drift", "wx wy wz")
        duration = hidden.get("tracker-drift.duration", DURATION_S)

        def seen(points: Array, times: Array, span_s: float | None) -> Array:
            u = np.clip(times / (span_s or duration), 0.0, 1.0)[:, None]
            return np.asarray(u * (v + np.cross(np.broadcast_to(w, points.shape), points)))

        return Physics(seen=seen)


EFFECTS = (TrackerDrift(),)
