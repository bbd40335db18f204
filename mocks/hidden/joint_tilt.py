"""First axes of universal joints that point off, in the hexapod's body."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Site, Table, of_names


class JointTilt(HiddenEffect):
    """Small turns about local y and z of each joint."""

    id = "joint-tilt"
    numbers = rf"{LIMB}\.(base|platform)\.(y|z)"
    says = "rad: turn of a joint about its local y or z"
    machines = ("hexapod",)
    arms = False
    trial = 2e-3

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """All joints."""
        names = [
            f"joint-tilt.{limb}.{body}.{axis}"
            for limb in site.limbs
            for body in ("base", "platform")
            for axis in "yz"
        ]
        return of_names(names, rng)

    def example(self, site: Site) -> Table:
        """Both axes of a joint at the base, and of one on the platform, each on another leg."""
        axes = ("base.y", "base.z", "platform.y", "platform.z")
        sizes = (2e-3, -1e-3, 1e-3, -2e-3)
        return {
            f"joint-tilt.{limb}.{axis}": size
            for limb, axis, size in zip(site.limbs, axes, sizes, strict=False)
        }


EFFECTS = (JointTilt(),)
