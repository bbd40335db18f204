"""A drive loses counts: from then on it stands elsewhere than it says."""

import numpy as np

from mocks.hidden.effect import LIMB, HiddenEffect, Physics, Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.circumstances import Circumstances, Stroke
from mocks.physics.pose import Array


class ActuatorStep(HiddenEffect):
    """A length for each actuator, all lost at one moment."""

    id = "actuator-step"
    numbers = f"{LIMB}|t0"
    says = "mm (rad): how far an actuator is off from t0 s on"
    steady = ("t0",)
    trial_rotary = 1e-5

    def draw(self, site: Site, rng: np.random.Generator) -> Table:
        """One actuator, in the middle part of the run."""
        limb = site.limbs[rng.integers(len(site.limbs))]
        moment = float(rng.uniform(0.2, 0.8)) * site.span_s
        sign = float(rng.choice([-1.0, 1.0]))
        return {f"actuator-step.{limb}": sign, "actuator-step.t0": moment}

    def example(self, site: Site) -> Table:
        """The second actuator, past half way."""
        size = 0.02 * site.stroke.per_mm
        return {f"actuator-step.{site.limbs[1]}": size, "actuator-step.t0": 0.55 * site.span_s}

    def physics(self, hidden: Hidden, limbs: tuple[str, ...], stroke: Stroke) -> Physics:
        """Nothing before, all of it after."""
        lost = hidden.limbs("actuator-step.*", limbs)
        moment = hidden.get("actuator-step.t0", np.inf)

        def extension(c: Circumstances) -> Array:
            return np.asarray(np.outer(c.time >= moment, lost))

        return Physics(extension=extension)


EFFECTS = (ActuatorStep(),)
