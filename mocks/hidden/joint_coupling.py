"""A joint of an arm that is carried along by one before it."""

import numpy as np

from mocks.hidden.effect import HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array


class JointCoupling(HiddenEffect):
    """What one joint turns, another turns too, a little."""

    id = "joint-coupling"
    numbers = r"q\d\.q\d"
    says = "1: how much the first joint follows the second"
    machines = ("arm",)
    trial = 1e-4

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """Two neighbours."""
        follows = int(rng.integers(1, len(site.limbs)))
        pair = f"{site.limbs[follows]}.{site.limbs[follows - 1]}"
        return {f"joint-coupling.{pair}": float(rng.standard_normal())}

    def example(self, site: Site) -> Table:
        """A third joint on a drive rod."""
        return {f"joint-coupling.{site.limbs[2]}.{site.limbs[1]}": 4e-4}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """By the names of both."""
        ratio = np.array(
            [[hidden.get(f"joint-coupling.{one}.{other}") for other in limbs] for one in limbs]
        )

        def extension(c: Circumstances) -> Array:
            return np.asarray(c.extension @ ratio.T)

        return Physics(extension=extension)


EFFECTS = (JointCoupling(),)
